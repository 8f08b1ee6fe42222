#pragma once

#include <memory>
#include <string>
#include <vector>

#include "uniphy/inference/fit.hpp"

namespace uniphy {

/// What a fit minimises: the observation, the variables and the horizons of the schedule in one,
/// with the loss and its gradient at a candidate. Knows nothing of the order in which points are
/// tried. Immutable, so that candidates can be evaluated side by side.
class FitProblem {
 public:
  /// Keeps references to the arguments; `motion`, unless null, takes the place of the observed
  /// initial velocity. Throws Error where the schedule has no last stage with horizon 1 or the
  /// model does not fit.
  FitProblem(const Observation& observation, const std::string& name, const FitVariables& variables,
             const FitOptions& options, const RigidMotion* motion = nullptr);

  const FitVariables& variables() const { return variables_; }
  int stages() const { return static_cast<int>(options_.stages.size()); }
  std::ptrdiff_t contact() const { return contact_; }
  std::ptrdiff_t frames() const { return observation_.frames; }
  std::ptrdiff_t frames(int stage) const;  ///< that the stage compares
  double horizon_time(int stage) const;    ///< s

  /// A candidate at the start, with the observed initial velocity; its loss is not known yet.
  FitCandidate candidate(int start) const;
  /// The initial velocity of a candidate.
  RigidMotion motion(const FitCandidate& c) const;

  /// The error (m²) of every frame up to `frames`, infinite from where the roll-out fails.
  std::vector<double> frame_mse(const FitCandidate& c, std::ptrdiff_t frames) const;
  /// mse/size² and the prior, at the candidate's u.
  double loss(double mse, const torch::Tensor& u) const;

  /// Leaves to be moved in a stage, copies of the candidate's: u [size], and the change of the
  /// initial velocity [6] where it is fitted too, in units of 0.1 m/s and 0.5 rad/s.
  std::vector<torch::Tensor> leaves(const FitCandidate& c, int stage) const;
  bool with_velocity(int stage) const;

  struct Evaluation {
    torch::Tensor loss;  ///< [], infinite where the roll-out or its gradient failed
    double mse;          ///< m², likewise
  };
  /// The loss at the leaves over the stage's horizon; its gradient is left in their .grad(),
  /// undefined where the loss is not finite.
  Evaluation evaluate(const std::vector<torch::Tensor>& leaves, int stage) const;

  /// What least squares minimise at u with the initial velocity that is known, over the first
  /// `frames`: (x̂ − x)/size and the root of the prior, scaled so that the sum of the squares is
  /// loss(). Undefined where the roll-out fails. Of very many particles, every n-th is taken, so
  /// that a column of a Jacobian has no more than kMostResiduals numbers.
  torch::Tensor residuals(const torch::Tensor& u, std::ptrdiff_t frames) const;

  [[noreturn]] void refuse_starts() const;  ///< says why the first one cannot be simulated

 private:
  double prior_weight() const;
  torch::Tensor loss_of(const torch::Tensor& mse, const torch::Tensor& u) const;
  torch::Tensor velocities(const torch::Tensor& motion) const;

  const Observation& observation_;
  const std::string& name_;
  const FitVariables& variables_;
  const FitOptions& options_;
  ObservedSteps steps_;
  kernels::GridSettings grid_;
  double size_;
  RigidMotion motion_;
  std::ptrdiff_t contact_;
  torch::Tensor v0_, arm_;  ///< [particles, 3] observed velocity, position from the centre
  std::unique_ptr<const MotionObjective> objective_;
};

/// 8 MB a column: a Jacobian of thirty is 240 MB. The benchmark cube of the field over 1000 steps,
/// a frame every 5, has 603,000.
inline constexpr std::int64_t kMostResiduals = 1000000;

}  // namespace uniphy
