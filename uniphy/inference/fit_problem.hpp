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
  /// Keeps references to the arguments. Throws Error where the schedule has no last stage with
  /// horizon 1 or the model does not fit.
  FitProblem(const Observation& observation, const std::string& name, const FitVariables& variables,
             const FitOptions& options);

  const FitVariables& variables() const { return variables_; }
  int stages() const { return static_cast<int>(options_.stages.size()); }
  std::ptrdiff_t contact() const { return contact_; }
  std::ptrdiff_t frames() const { return observation_.frames; }
  std::ptrdiff_t frames(int stage) const;  ///< that the stage compares
  double horizon_time(int stage) const;    ///< s

  /// A candidate at `u` that comes from row `start`, with the observed initial velocity; its loss
  /// is not known yet.
  FitCandidate candidate(int start, const std::vector<double>& u) const;

  /// mse/size² and the prior.
  double loss(double mse, const std::vector<double>& u) const;
  /// The error (m²) of every frame up to `frames`, infinite from where the roll-out fails.
  std::vector<double> frame_mse(const FitCandidate& c, std::ptrdiff_t frames) const;
  /// Fills in the loss and mse at the stage's horizon; returns the gradient by the variables of
  /// pack(), empty where the loss is not finite.
  std::vector<double> evaluate(FitCandidate& c, int stage) const;

  /// The variables of a stage: u, and the initial velocity where it is fitted too.
  std::vector<double> pack(const FitCandidate& c, int stage) const;
  FitCandidate unpack(int start, const std::vector<double>& variables, int stage) const;

  [[noreturn]] void refuse_starts() const;  ///< says why the first one cannot be simulated

 private:
  bool with_velocity(int stage) const;
  double prior_weight() const;

  const Observation& observation_;
  const std::string& name_;
  const FitVariables& variables_;
  const FitOptions& options_;
  ObservedSteps steps_;
  kernels::GridSettings grid_;
  double size_;
  RigidMotion motion_;
  std::ptrdiff_t contact_;
  std::unique_ptr<const MotionObjective> objective_;
};

}  // namespace uniphy
