#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/rollout/rollout.hpp"
#include "uniphy/inference/observed_motion.hpp"

namespace uniphy {

/// A loss and its gradient by the adjoint of the roll-out.
struct Evaluation {
  double mse = 0;                  ///< m², infinite where the roll-out or its gradient failed
  std::vector<double> parameters;  ///< d mse / d(parameters of the law)
  std::array<double, 6> motion{};  ///< d mse / d(linear, angular velocity)
};

/// How well a law explains an observation: the mean over frames (the first included), particles and
/// coordinates of (x̂ − x)², x̂ from a roll-out that starts at the first observed frame, undeformed.
/// Immutable; calls may run at the same time.
class MotionObjective {
 public:
  virtual ~MotionObjective() = default;

  /// Mean over particles and coordinates at each of the first `frames` frames; infinite from where
  /// the roll-out fails.
  virtual std::vector<double> frame_mse(const kernels::LawDescription& law,
                                        const RigidMotion& motion, std::ptrdiff_t frames) const = 0;
  /// Over the first `frames` frames. The backward pass works from checkpoints, so memory grows with
  /// the root of the number of steps.
  virtual Evaluation evaluate(const kernels::LawDescription& law, const RigidMotion& motion,
                              std::ptrdiff_t frames) const = 0;
  /// The state at the observed frames; on_frame(frame, state) gets positions. Throws Error where
  /// the roll-out fails.
  virtual void simulate(
      const kernels::LawDescription& law, const RigidMotion& motion,
      const std::function<void(std::ptrdiff_t, const std::vector<double>&)>& on_frame) const = 0;
};

/// `dtype` is float32 or float64. The observation must outlive the objective.
std::unique_ptr<const MotionObjective> make_motion_objective(const Observation& observation,
                                                             const ObservedSteps& steps,
                                                             const kernels::GridSettings& grid,
                                                             const std::string& dtype);

/// Mean of the first `frames` numbers.
double mean_of_first(const std::vector<double>& frame_mse, std::ptrdiff_t frames);

}  // namespace uniphy
