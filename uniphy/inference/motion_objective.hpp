#pragma once

#include <torch/types.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "ops/rollout/rollout.hpp"
#include "uniphy/inference/cloud_comparison.hpp"
#include "uniphy/inference/companion.hpp"
#include "uniphy/inference/initial_fields.hpp"
#include "uniphy/inference/observed_motion.hpp"

namespace uniphy {

/// How well a law explains an observation: the mean over frames (the first included), points and
/// coordinates of (x̂ − x)², x̂ from a roll-out of the body that starts at the first observed frame.
/// Points that are no particles are tracers in it. What is hidden does not count: sums
/// are divided by the number of coordinates that a frame shows on average. Of clouds it is the mean
/// of their distance for one coordinate (CloudComparison). Immutable; calls may run
/// at the same time.
class MotionObjective {
 public:
  virtual ~MotionObjective() = default;

  /// That mean over the first `frames` frames, m², float64 [], by the op of the roll-out:
  /// differentiable by the parameters of the body (all particles) and by the fields that it
  /// starts with (those of tracers follow). Has the same bits on any number of threads. The
  /// backward pass works from checkpoints, so memory grows with the root of the number of steps
  /// (with the number itself where the roll-out goes step by step). Throws Error where the roll-out
  /// fails.
  virtual torch::Tensor mse(const ops::RolloutBody& body, const InitialFields& start,
                            std::ptrdiff_t frames) const = 0;
  /// x̂ − x, m, float64 [frames, 3 points], 0 where hidden, by the same roll-out; of clouds
  /// [frames, CloudComparison::columns()].
  virtual torch::Tensor residuals(const ops::RolloutBody& body, const InitialFields& start,
                                  std::ptrdiff_t frames) const = 0;
  /// Share of each of the first `frames` frames in that mean: their mean is mse(); infinite from
  /// where the roll-out fails. Nothing is kept for gradients: this is how starts are compared.
  virtual std::vector<double> frame_mse(const kernels::LawDescription& law,
                                        const InitialState& state, std::ptrdiff_t frames) const = 0;
  /// Coordinates that a frame shows on average.
  virtual double seen_per_frame() const = 0;
  /// dx/dx₀ of every point at the first `frames` [frames, points, 3, 3], float64, as tracers have
  /// it (kernels::Tracer). Throws Error where the roll-out fails.
  virtual torch::Tensor flow_gradients(const kernels::LawDescription& law,
                                       const InitialState& state, std::ptrdiff_t frames) const = 0;
  /// Deformation gradients of all particles at the first `frames` [frames, particles, 9], as the
  /// law leaves them. Throws Error where the roll-out fails.
  virtual std::vector<double> deformations(const kernels::LawDescription& law,
                                           const InitialState& state,
                                           std::ptrdiff_t frames) const = 0;
  /// The state at the observed frames; on_frame(frame, x) gets the positions of the points. Throws
  /// Error where the roll-out fails.
  virtual void simulate(
      const kernels::LawDescription& law, const InitialState& state,
      const std::function<void(std::ptrdiff_t, const std::vector<double>&)>& on_frame) const = 0;
};

/// `dtype`, the precision of the roll-outs, is float32 or float64; `rollout` is fused
/// (ops::rollout) or stepwise (stepwise_rollout); `detail` is that of clouds. `companions` move
/// along, by their own laws; what is compared is the observed body alone. The observation must
/// outlive the objective.
std::unique_ptr<const MotionObjective> make_motion_objective(
    const Observation& observation, const ObservedSteps& steps, const kernels::GridSettings& grid,
    const std::string& dtype, const std::string& rollout = "fused",
    CloudDetail detail = CloudDetail::all, const std::vector<Companion>& companions = {});

/// Mean of the first `frames` numbers.
double mean_of_first(const std::vector<double>& frame_mse, std::ptrdiff_t frames);

}  // namespace uniphy
