#include "uniphy/inference/motion_objective.hpp"

#include <cmath>
#include <limits>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <class T>
class RolloutObjective : public MotionObjective {
 public:
  RolloutObjective(const Observation& observation, const ObservedSteps& steps,
                   const kernels::GridSettings& grid)
      : observation_(observation), steps_(steps), grid_(grid) {
    const std::vector<double> mass = observed_mass(observation);
    mass_.assign(mass.begin(), mass.end());
    volume_.assign(observation.volume.begin(), observation.volume.end());
    start_.assign(observation.x.begin(), observation.x.begin() + 3 * observation.particles);
  }

  std::vector<double> frame_mse(const kernels::LawDescription& law, const RigidMotion& motion,
                                std::ptrdiff_t frames) const override {
    std::vector<double> result(frames, kInfinity);
    std::ptrdiff_t frame = 0;
    try {
      run(law, motion, frames, [&](const std::vector<T>& x) {
        const double mse = frame_error(x.data(), frame, nullptr);
        if (std::isfinite(mse)) result[frame] = mse;
        ++frame;
      });
    } catch (const Error&) {  // left the grid: the later frames stay infinite
    }
    return result;
  }

  Evaluation evaluate(const kernels::LawDescription& law, const RigidMotion& motion,
                      std::ptrdiff_t frames) const override {
    Evaluation result;
    result.mse = kInfinity;
    try {
      const kernels::Rollout<T> rollout = rollout_of(law);
      const std::ptrdiff_t steps = steps_.last(frames), stride = steps_.stride;
      const std::size_t row = start_.size();
      std::vector<T> x(row * kernels::Rollout<T>::frame_count(steps, stride));
      kernels::RolloutTape<T> tape;
      rollout.record(initial(motion), steps, stride, x.data(), nullptr, &tape);

      std::vector<T> grad(x.size(), T(0));
      double mse = 0;
      for (std::ptrdiff_t f = 0; f < frames; ++f) {
        const std::size_t at = steps_.step[f] / stride * row;
        mse += frame_error(&x[at], f, &grad[at]) / static_cast<double>(frames);
      }
      // frame_error leaves the differences; d(mean of squares) = 2/N times them.
      const T scale = T(2.0 / (static_cast<double>(frames) * static_cast<double>(row)));
      for (T& g : grad) g *= scale;
      const kernels::RolloutGradient<T> back = rollout.adjoint(tape, grad.data(), nullptr);
      result.parameters.assign(back.parameters[0].begin(), back.parameters[0].end());
      const std::vector<double> position(start_.begin(), start_.end());
      result.motion = motion.gradient(position, {back.state.v.begin(), back.state.v.end()});
      if (std::isfinite(mse) && finite(result)) result.mse = mse;
    } catch (const Error&) {
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
  static bool finite(const Evaluation& e) {
    bool good = true;
    for (const double g : e.parameters) good = good && std::isfinite(g);
    for (const double g : e.motion) good = good && std::isfinite(g);
    return good;
  }

  kernels::Rollout<T> rollout_of(const kernels::LawDescription& law) const {
    return kernels::Rollout<T>(grid_, {{0, observation_.particles, kernels::make_law<T>(law)}},
                               mass_, volume_);
  }

  kernels::ParticleState<T> initial(const RigidMotion& motion) const {
    const std::vector<double> v =
        motion.velocities({observation_.x.begin(), observation_.x.begin() + start_.size()});
    return kernels::ParticleState<T>::undeformed(start_, {v.begin(), v.end()});
  }

  template <class Visit>
  void run(const kernels::LawDescription& law, const RigidMotion& motion, std::ptrdiff_t frames,
           const Visit& visit) const {
    const kernels::Rollout<T> rollout = rollout_of(law);
    kernels::ParticleState<T> state = initial(motion);
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

  /// Mean squared error of one frame; the differences go to `difference` unless null.
  double frame_error(const T* x, std::ptrdiff_t frame, T* difference) const {
    const double* seen = observation_.positions(frame);
    double sum = 0;
    for (std::size_t k = 0; k < start_.size(); ++k) {
      const double d = static_cast<double>(x[k]) - seen[k];
      if (difference != nullptr) difference[k] = T(d);
      sum += d * d;
    }
    return sum / static_cast<double>(start_.size());
  }

  const Observation& observation_;
  ObservedSteps steps_;
  kernels::GridSettings grid_;
  std::vector<T> mass_, volume_, start_;
};

}  // namespace

std::unique_ptr<const MotionObjective> make_motion_objective(const Observation& observation,
                                                             const ObservedSteps& steps,
                                                             const kernels::GridSettings& grid,
                                                             const std::string& dtype) {
  if (dtype == "float64") {
    return std::make_unique<RolloutObjective<double>>(observation, steps, grid);
  }
  return std::make_unique<RolloutObjective<float>>(observation, steps, grid);
}

double mean_of_first(const std::vector<double>& frame_mse, std::ptrdiff_t frames) {
  double sum = 0;
  for (std::ptrdiff_t f = 0; f < frames; ++f) sum += frame_mse[f];
  return sum / static_cast<double>(frames);
}

}  // namespace uniphy
