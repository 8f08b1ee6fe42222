#pragma once

#include <torch/types.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "ops/rollout/rollout.hpp"
#include "uniphy/inference/observed_motion.hpp"

namespace uniphy {

/// How well a law explains an observation: the mean over frames (the first included), particles and
/// coordinates of (x̂ − x)², x̂ from a roll-out that starts at the first observed frame, undeformed.
/// Immutable; calls may run at the same time.
class MotionObjective {
 public:
  virtual ~MotionObjective() = default;

  /// That mean over the first `frames` frames, m², float64 [], by the op of the roll-out:
  /// differentiable by the parameters of the body (all particles) and by v0 [particles, 3],
  /// float64, m/s. Has the same bits on any number of threads. The backward pass works from
  /// checkpoints, so memory grows with the root of the number of steps (with the number itself
  /// where the roll-out goes step by step). Throws Error where the roll-out fails.
  virtual torch::Tensor mse(const ops::RolloutBody& body, const torch::Tensor& v0,
                            std::ptrdiff_t frames) const = 0;
  /// x̂ − x, m, float64 [frames, 3 particles], by the same roll-out.
  virtual torch::Tensor residuals(const ops::RolloutBody& body, const torch::Tensor& v0,
                                  std::ptrdiff_t frames) const = 0;
  /// Mean over particles and coordinates at each of the first `frames` frames; infinite from where
  /// the roll-out fails. Nothing is kept for gradients: this is how starts are compared.
  virtual std::vector<double> frame_mse(const kernels::LawDescription& law,
                                        const RigidMotion& motion, std::ptrdiff_t frames) const = 0;
  /// The state at the observed frames; on_frame(frame, state) gets positions. Throws Error where
  /// the roll-out fails.
  virtual void simulate(
      const kernels::LawDescription& law, const RigidMotion& motion,
      const std::function<void(std::ptrdiff_t, const std::vector<double>&)>& on_frame) const = 0;
};

/// `dtype`, the precision of the roll-outs, is float32 or float64; `rollout` is fused
/// (ops::rollout) or stepwise (stepwise_rollout). The observation must outlive the objective.
std::unique_ptr<const MotionObjective> make_motion_objective(const Observation& observation,
                                                             const ObservedSteps& steps,
                                                             const kernels::GridSettings& grid,
                                                             const std::string& dtype,
                                                             const std::string& rollout = "fused");

/// Mean of the first `frames` numbers.
double mean_of_first(const std::vector<double>& frame_mse, std::ptrdiff_t frames);

}  // namespace uniphy
