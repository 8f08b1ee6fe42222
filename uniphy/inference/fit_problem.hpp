#pragma once

#include <memory>
#include <string>
#include <vector>

#include "uniphy/inference/fit.hpp"

namespace uniphy {

class StartCorrection;

/// What a fit minimises: the observation, the variables and the horizons of the schedule in one,
/// with the loss and its gradient at a candidate. Knows nothing of the order in which points are
/// tried. Immutable, so that candidates can be evaluated side by side.
class FitProblem {
 public:
  /// Keeps references to the arguments; `motion`, unless null, takes the place of the observed
  /// initial velocity. Throws Error where the schedule has no last stage with horizon 1 or the
  /// model does not fit.
  FitProblem(const Observation& observation, const std::string& name, const FitVariables& variables,
             const FitOptions& options, const InitialState* motion = nullptr);

  const FitVariables& variables() const { return variables_; }
  int stages() const { return static_cast<int>(options_.stages.size()); }
  std::ptrdiff_t contact() const { return contact_; }
  std::ptrdiff_t frames() const { return observation_.frames; }
  /// Whether the points are tracers or so noisy that where they start has to be fitted, too.
  bool fits_starts() const { return fits_starts_; }
  double noise_over_size() const { return noise_ / size_; }
  /// How strongly least squares over the first `frames` are pulled to where they begin at least.
  double least_pull(std::ptrdiff_t frames) const;
  /// Coordinates that the first `frames` show, about.
  double seen(std::ptrdiff_t frames) const;
  std::ptrdiff_t frames(int stage) const;  ///< that the stage compares
  double horizon_time(int stage) const;    ///< s

  /// A candidate at the start, with the observed initial velocity; its loss is not known yet.
  FitCandidate candidate(int start) const;
  /// The initial state of a candidate.
  InitialState motion(const FitCandidate& c) const;

  /// The error (m²) of every frame up to `frames`, infinite from where the roll-out fails.
  std::vector<double> frame_mse(const FitCandidate& c, std::ptrdiff_t frames) const;
  /// mse/size² and the prior, at the candidate's u.
  double loss(double mse, const torch::Tensor& u) const;

  /// The error (m²) of a point with that loss.
  double mse_of(double loss, const torch::Tensor& u) const;

  /// Leaves to be moved in a stage, copies of the candidate's: u [size], and where it moves the
  /// initial state the change of it [motion_size()], in the units of motion_units().
  std::vector<torch::Tensor> leaves(const FitCandidate& c, int stage) const;
  /// Whether a stage moves the initial velocity: the last one does. Gradients do so only where
  /// there is noise: else the first frames tell it better than a law that is still far off, and a
  /// quasi-Newton method has six more directions to learn.
  bool with_velocity(int stage) const;

  struct Evaluation {
    torch::Tensor loss;  ///< [], infinite where the roll-out or its gradient failed
    double mse;          ///< m², likewise
  };
  /// The loss at the leaves over the stage's horizon; its gradient is left in their .grad(),
  /// undefined where the loss is not finite.
  Evaluation evaluate(const std::vector<torch::Tensor>& leaves, int stage) const;

  /// Numbers of the change of the initial state.
  int motion_size() const { return static_cast<int>(units_.numel()); }
  /// Their units [motion_size()], those of leaves(); the numbers are as in numbers_of().
  const torch::Tensor& motion_units() const { return units_; }
  /// What least squares minimise over the first `frames` at a point: u, or u and the change of the
  /// initial state [size + motion_size()]. (x̂ − x)/size, or what `starts`, of as many frames,
  /// leaves of it, and the root of the prior, scaled so that the sum of the squares is loss().
  /// Undefined where the roll-out fails. Of very many points, every n-th is taken, so that a column
  /// of a Jacobian has no more than kMostResiduals numbers.
  torch::Tensor residuals(const torch::Tensor& point, std::ptrdiff_t frames,
                          const StartCorrection* starts = nullptr) const;
  /// x̂ − x [frames, 3 points], m, at such a point. Throws Error where the roll-out fails.
  torch::Tensor misses(const torch::Tensor& point, std::ptrdiff_t frames) const;
  /// The change of the initial state that makes it `to`, [motion_size()] in the units of leaves().
  torch::Tensor change_to(const InitialState& to) const;
  /// The initial state at such a point.
  InitialState motion_at(const torch::Tensor& point) const;
  /// Of the starts, by the flow at such a point.
  StartCorrection start_correction(const torch::Tensor& point, std::ptrdiff_t frames) const;

  [[noreturn]] void refuse_starts() const;  ///< says why the first one cannot be simulated

 private:
  double prior_weight() const;
  torch::Tensor loss_of(const torch::Tensor& mse, const torch::Tensor& u) const;
  InitialFields fields(const torch::Tensor& change) const;
  /// What a column of a Jacobian of least squares at a point of so many numbers may have.
  static std::int64_t most_residuals(std::int64_t columns);

  const Observation& observation_;
  const std::string& name_;
  const FitVariables& variables_;
  const FitOptions& options_;
  ObservedSteps steps_;
  kernels::GridSettings grid_;
  double size_;
  InitialState motion_;
  std::ptrdiff_t contact_;
  double noise_;  ///< m
  bool fits_velocity_, fits_starts_;
  InitialBasis basis_;              ///< of particles and tracers
  torch::Tensor observed_, units_;  ///< [motion_size()] numbers of motion_, units of their change
  torch::Tensor hidden_;            ///< [frames, 3 points]; undefined: nothing is
  std::unique_ptr<const MotionObjective> objective_;
};

/// The error over size by which noise, over size, of so many coordinates tells a number with a
/// spread of 1 from where it began; at least 1e-6, what double roll-outs tell.
double least_pull(double noise, double coordinates);

/// 8 MB a column: a Jacobian of thirty is 240 MB. The benchmark cube of the field over 1000 steps,
/// a frame every 5, has 603,000. Of more columns, each has less.
inline constexpr std::int64_t kMostResiduals = 1000000, kMostInJacobian = 30000000;

}  // namespace uniphy
