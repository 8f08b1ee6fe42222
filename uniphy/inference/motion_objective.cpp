#include "uniphy/inference/motion_objective.hpp"

#include <omp.h>
#include <torch/torch.h>

#include <cmath>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/stepwise_rollout.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <class T>
class RolloutObjective : public MotionObjective {
 public:
  RolloutObjective(const Observation& observation, const ObservedSteps& steps,
                   const kernels::GridSettings& grid, const std::string& rollout)
      : observation_(observation),
        steps_(steps),
        grid_(grid),
        rollout_(rollout == "stepwise" ? &stepwise_rollout : &ops::rollout) {
    const std::vector<double> mass = observed_mass(observation);
    mass_.assign(mass.begin(), mass.end());
    volume_.assign(observation.volume.begin(), observation.volume.end());
    start_.assign(observation.x.begin(), observation.x.begin() + 3 * observation.particles);
    const std::int64_t P = observation.particles;
    const torch::Dtype dtype = torch::CppTypeToScalarType<T>::value;
    x0_ = torch::tensor(start_, dtype).view({P, 3});
    mass_tensor_ = torch::tensor(mass_, dtype);
    volume_tensor_ = torch::tensor(volume_, dtype);
    seen_ = torch::tensor(observation.x, torch::kFloat64).view({-1, 3 * P});
    std::vector<std::int64_t> states;  // among those that the roll-out hands out
    for (const std::ptrdiff_t step : steps.step) states.push_back(step / steps.stride);
    states_ = torch::tensor(states);
  }

  Tensor mse(const ops::RolloutBody& body, const Tensor& v0, std::ptrdiff_t frames) const override {
    // First within the frames: sums of rows have one order on any number of threads.
    return residuals(body, v0, frames).square().mean(1).mean();
  }

  Tensor residuals(const ops::RolloutBody& body, const Tensor& v0,
                   std::ptrdiff_t frames) const override {
    ops::RolloutSettings settings;
    settings.grid = grid_;
    settings.steps = steps_.last(frames);
    settings.every = steps_.stride;
    Tensor x = rollout_(x0_, v0.to(x0_.dtype()), {}, {}, mass_tensor_, volume_tensor_, {body},
                        settings, {})
                   .x;
    if (x.size(0) != frames) x = x.index_select(0, states_.slice(0, 0, frames));
    return x.flatten(1).to(torch::kFloat64) - seen_.slice(0, 0, frames);
  }

  std::vector<double> frame_mse(const kernels::LawDescription& law, const RigidMotion& motion,
                                std::ptrdiff_t frames) const override {
    std::vector<double> result(frames, kInfinity);
    std::ptrdiff_t frame = 0;
    try {
      run(law, motion, frames, [&](const std::vector<T>& x) {
        const double mse = frame_error(x, frame);
        if (std::isfinite(mse)) result[frame] = mse;
        ++frame;
      });
    } catch (const Error&) {  // left the grid: the later frames stay infinite
    }
    return result;
  }

  void simulate(const kernels::LawDescription& law, const RigidMotion& motion,
                const std::function<void(std::ptrdiff_t, const std::vector<double>&)>& on_frame)
      const override {
    std::ptrdiff_t frame = 0;
    run(law, motion, observation_.frames, [&](const std::vector<T>& x) {
      on_frame(frame++, std::vector<double>(x.begin(), x.end()));
    });
  }

 private:
  template <class Visit>
  void run(const kernels::LawDescription& law, const RigidMotion& motion, std::ptrdiff_t frames,
           const Visit& visit) const {
    const kernels::Rollout<T> rollout(
        grid_, {{0, observation_.particles, kernels::make_law<T>(law)}}, mass_, volume_);
    const std::vector<double> v =
        motion.velocities({observation_.x.begin(), observation_.x.begin() + start_.size()});
    auto state = kernels::ParticleState<T>::undeformed(start_, {v.begin(), v.end()});
    std::ptrdiff_t next = 0;
    kernels::RunOptions<T> options;
    options.every = steps_.stride;
    options.on_frame = [&](std::ptrdiff_t step, const kernels::ParticleState<T>& at) {
      if (next < frames && step == steps_.step[next]) {
        visit(at.x);
        ++next;
      }
      return next < frames;
    };
    rollout.run(state, steps_.last(frames), options);
  }

  double frame_error(const std::vector<T>& x, std::ptrdiff_t frame) const {
    const double* seen = observation_.positions(frame);
    double sum = 0;
    for (std::size_t k = 0; k < x.size(); ++k) {
      const double d = static_cast<double>(x[k]) - seen[k];
      sum += d * d;
    }
    return sum / static_cast<double>(x.size());
  }

  const Observation& observation_;
  ObservedSteps steps_;
  kernels::GridSettings grid_;
  decltype(&ops::rollout) rollout_;
  std::vector<T> mass_, volume_, start_;
  Tensor x0_, mass_tensor_, volume_tensor_;  // the same, in T
  Tensor seen_;                              // [frames, 3 particles], float64
  Tensor states_;                            // [frames]
};

/// LibTorch chooses the number of OpenMP threads anew when a thread first asks for it. It is asked
/// here, and the number that --threads chose is put back.
void keep_thread_count() {
  const int threads = omp_get_max_threads();
  at::get_num_threads();
  omp_set_num_threads(threads);
}

}  // namespace

std::unique_ptr<const MotionObjective> make_motion_objective(const Observation& observation,
                                                             const ObservedSteps& steps,
                                                             const kernels::GridSettings& grid,
                                                             const std::string& dtype,
                                                             const std::string& rollout) {
  keep_thread_count();
  if (dtype == "float64") {
    return std::make_unique<RolloutObjective<double>>(observation, steps, grid, rollout);
  }
  return std::make_unique<RolloutObjective<float>>(observation, steps, grid, rollout);
}

double mean_of_first(const std::vector<double>& frame_mse, std::ptrdiff_t frames) {
  double sum = 0;
  for (std::ptrdiff_t f = 0; f < frames; ++f) sum += frame_mse[f];
  return sum / static_cast<double>(frames);
}

}  // namespace uniphy
