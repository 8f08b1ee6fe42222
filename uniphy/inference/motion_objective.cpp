#include "uniphy/inference/motion_objective.hpp"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/tracer.hpp"
#include "uniphy/inference/observed_frames.hpp"
#include "uniphy/inference/stepwise_rollout.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <class T>
class RolloutObjective : public MotionObjective {
 public:
  RolloutObjective(const Observation& observation, const ObservedSteps& steps,
                   const kernels::GridSettings& grid, const std::string& rollout,
                   CloudDetail detail, const std::vector<Companion>& companions)
      : observation_(observation),
        steps_(steps),
        grid_(grid),
        rollout_(rollout == "stepwise" ? &stepwise_rollout : &ops::rollout),
        particles_(observation.particles),
        points_(observation.cloud > 0 ? observation.particles : observation.points()),
        companions_(companions),
        beside_(fields_beside(companions)),
        tracers_(observation.tracers),
        all_(ensemble(tracers_)),
        first_point_(observation.tracked() ? all_.material() : 0) {
    const torch::Dtype dtype = torch::CppTypeToScalarType<T>::value;
    x0_ = torch::tensor(all_.x, torch::kFloat64).to(dtype).view({-1, 3});
    mass_tensor_ = torch::tensor(all_.mass, dtype);
    volume_tensor_ = torch::tensor(all_.volume, dtype);
    if (observation.cloud > 0) {
      clouds_ = std::make_unique<const CloudComparison>(observation, detail);
      per_frame_ = clouds_->seen_per_frame();
    } else {
      see(observation);
    }
    std::vector<std::int64_t> states;  // among those that the roll-out hands out
    for (const std::ptrdiff_t step : steps.step) states.push_back(step / steps.stride);
    states_ = torch::tensor(states);
    fraction_ = torch::tensor(steps.fraction, torch::kFloat64).view({-1, 1});
    between_ = std::any_of(steps.fraction.begin(), steps.fraction.end(),
                           [](double share) { return share > 0; });
  }

  Tensor mse(const ops::RolloutBody& body, const InitialFields& start,
             std::ptrdiff_t frames) const override {
    // First within the frames: sums of rows have one order on any number of threads.
    const Tensor square = residuals(body, start, frames).square();
    if (!hidden_.defined() && clouds_ == nullptr) return square.mean(1).mean();
    return square.sum(1).mean() / per_frame_;
  }

  Tensor residuals(const ops::RolloutBody& body, const InitialFields& start,
                   std::ptrdiff_t frames) const override {
    ops::RolloutSettings settings;
    settings.grid = grid_;
    settings.steps = steps_.last(frames);
    settings.every = steps_.stride;
    std::vector<ops::RolloutBody> bodies{body};
    for (const Companion& c : companions_) {
      ops::RolloutBody& other = bodies.emplace_back();
      other.begin = bodies[bodies.size() - 2].end;
      other.end = other.begin + static_cast<std::ptrdiff_t>(c.volume.size());
      other.law = c.law;
    }
    if (!tracers_.empty()) {
      ops::RolloutBody& tracers = bodies.emplace_back();
      tracers.begin = all_.material();
      tracers.end = x0_.size(0);
      tracers.tracers = true;
    }
    const InitialFields fields = with_companions(start);
    const auto cast = [&](const Tensor& t) { return t.defined() ? t.to(x0_.dtype()) : t; };
    const Tensor states = rollout_(x0_, cast(fields.v), cast(fields.C), cast(fields.F),
                                   mass_tensor_, volume_tensor_, bodies, settings, {})
                              .x.slice(1, first_point_, first_point_ + points_)
                              .flatten(1)
                              .to(torch::kFloat64);
    const Tensor x = at_frames(states, frames);
    if (clouds_ != nullptr) return clouds_->residuals(x.view({frames, particles_, 3}));
    const Tensor r = x - seen_.slice(0, 0, frames);
    return hidden_.defined() ? r.masked_fill(hidden_.slice(0, 0, frames), 0) : r;
  }

  double seen_per_frame() const override { return per_frame_; }

  std::vector<double> frame_mse(const kernels::LawDescription& law, const InitialState& from,
                                std::ptrdiff_t frames) const override {
    if (clouds_ != nullptr) return cloud_mse(law, from, frames);
    std::vector<double> result(frames, kInfinity);
    try {
      visit_frames(rollout_of(law, all_), initial(from), steps_, frames,
                   [&](std::ptrdiff_t frame, const std::vector<T>& x) {
                     const double mse = frame_error(points_of(x), frame);
                     if (std::isfinite(mse)) result[frame] = mse;
                   });
    } catch (const Error&) {  // left the grid: the later frames stay infinite
    }
    return result;
  }

  void simulate(const kernels::LawDescription& law, const InitialState& from,
                const std::function<void(std::ptrdiff_t, const std::vector<double>&)>& on_frame)
      const override {
    visit_frames(rollout_of(law, all_), initial(from), steps_, observation_.frames,
                 [&](std::ptrdiff_t frame, const std::vector<T>& x) {
                   on_frame(frame, {points_of(x), points_of(x) + 3 * points_});
                 });
  }

  Tensor flow_gradients(const kernels::LawDescription& law, const InitialState& from,
                        std::ptrdiff_t frames) const override {
    // Of points that are particles, too, tracers tell: the F of a particle is what its law leaves.
    const std::vector<double> starts(all_.x.begin() + 3 * first_point_,
                                     all_.x.begin() + 3 * (first_point_ + points_));
    const Ensemble points = ensemble(starts);
    const std::int64_t begin = points.material();
    return torch::tensor(gradients(rollout_of(law, points), state_of(from, points, starts), frames,
                                   begin, begin + points_),
                         torch::kFloat64)
        .view({frames, points_, 3, 3});
  }

  std::vector<double> deformations(const kernels::LawDescription& law, const InitialState& from,
                                   std::ptrdiff_t frames) const override {
    return gradients(rollout_of(law, all_), initial(from), frames, 0, particles_);
  }

 private:
  void see(const Observation& observation) {
    seen_ = torch::tensor(observation.x, torch::kFloat64).view({-1, 3 * points_});
    const Tensor hidden = seen_.isnan();
    const std::int64_t count = seen_.numel() - hidden.sum().item<std::int64_t>();
    if (count < seen_.numel()) hidden_ = hidden;
    per_frame_ = static_cast<double>(count) / static_cast<double>(observation.frames);
  }

  std::vector<double> cloud_mse(const kernels::LawDescription& law, const InitialState& from,
                                std::ptrdiff_t frames) const {
    const torch::NoGradGuard no_grad;
    std::vector<double> all, result(frames, kInfinity);
    try {
      visit_frames(rollout_of(law, all_), initial(from), steps_, frames,
                   [&](std::ptrdiff_t, const std::vector<T>& x) {
                     all.insert(all.end(), x.begin(), x.begin() + 3 * particles_);
                   });
    } catch (const Error&) {  // left the grid: the later frames stay infinite
    }
    const Tensor x = torch::tensor(all, torch::kFloat64).view({-1, particles_, 3});
    if (x.size(0) == 0) return result;
    const Tensor square = clouds_->residuals(x).square().sum(1) / per_frame_;
    for (std::int64_t f = 0; f < x.size(0); ++f) {
      const double mse = square[f].item<double>();
      if (std::isfinite(mse)) result[f] = mse;
    }
    return result;
  }

  /// All that is rolled out: the body, its companions, tracers.
  struct Ensemble {
    std::vector<double> x;          ///< [all, 3] m
    std::vector<T> mass, volume;    ///< [all]
    std::vector<std::int64_t> end;  ///< of the body and of each companion

    std::int64_t material() const { return end.back(); }
  };
  Ensemble ensemble(const std::vector<double>& tracers) const {
    Ensemble e;
    e.x = observation_.start();
    const std::vector<double> mass = observed_mass(observation_);
    e.mass.assign(mass.begin(), mass.end());
    e.volume.assign(observation_.volume.begin(), observation_.volume.end());
    e.end.push_back(particles_);
    for (const Companion& c : companions_) {
      e.x.insert(e.x.end(), c.x.begin(), c.x.end());
      for (const double volume : c.volume) {
        e.volume.push_back(static_cast<T>(volume));
        e.mass.push_back(static_cast<T>(c.density * volume));
      }
      e.end.push_back(static_cast<std::int64_t>(e.volume.size()));
    }
    e.x.insert(e.x.end(), tracers.begin(), tracers.end());
    e.mass.resize(e.x.size() / 3, T(0));
    e.volume.resize(e.x.size() / 3, T(0));
    return e;
  }

  kernels::Rollout<T> rollout_of(const kernels::LawDescription& law, const Ensemble& e) const {
    std::vector<kernels::BodyRange<T>> bodies{{0, particles_, kernels::make_law<T>(law)}};
    for (std::size_t c = 0; c < companions_.size(); ++c)
      bodies.push_back({e.end[c], e.end[c + 1], kernels::make_law<T>(companions_[c].law)});
    const auto all = static_cast<std::ptrdiff_t>(e.mass.size());
    if (all > e.material())
      bodies.push_back({e.material(), all, std::make_shared<const kernels::Tracer<T>>()});
    return {grid_, bodies, e.mass, e.volume};
  }

  /// Of the particles of all companions.
  static InitialFields fields_beside(const std::vector<Companion>& companions) {
    std::vector<InitialFields> each;
    bool still = true;  // C = 0 and F = I
    for (const Companion& c : companions) {
      const auto particles = static_cast<std::int64_t>(c.volume.size());
      still = !each.emplace_back(fields_of(c.motion, c.x, particles)).C.defined() && still;
    }
    if (each.empty()) return {};
    std::vector<Tensor> v, C, F;
    for (const InitialFields& f : each) {
      v.push_back(f.v);
      C.push_back(or_zeros(f.C, f.v.size(0)));
      F.push_back(or_identity(f.F, f.v.size(0)));
    }
    if (still) return {torch::cat(v), {}, {}};
    return {torch::cat(v), torch::cat(C), torch::cat(F)};
  }
  static Tensor or_zeros(const Tensor& C, std::int64_t rows) {
    return C.defined() ? C : torch::zeros({rows, 3, 3}, torch::kFloat64);
  }
  static Tensor or_identity(const Tensor& F, std::int64_t rows) {
    return F.defined() ? F : torch::eye(3, torch::kFloat64).expand({rows, 3, 3});
  }

  /// The fields of the body and of tracers, with those of the companions between them.
  InitialFields with_companions(const InitialFields& own) const {
    if (companions_.empty()) return own;
    const std::int64_t rows = own.v.size(0), others = beside_.v.size(0);
    const auto joined = [&](const Tensor& mine, const Tensor& theirs) {
      return torch::cat({mine.slice(0, 0, particles_), theirs, mine.slice(0, particles_, rows)});
    };
    InitialFields all{joined(own.v, beside_.v)};
    if (own.C.defined() || beside_.C.defined()) {
      all.C = joined(or_zeros(own.C, rows), or_zeros(beside_.C, others));
      all.F = joined(or_identity(own.F, rows), or_identity(beside_.F, others));
    }
    return all;
  }

  /// F of the particles [begin, end) at the first frames; within a step it hardly changes.
  std::vector<double> gradients(const kernels::Rollout<T>& rollout, kernels::ParticleState<T> state,
                                std::ptrdiff_t frames, std::int64_t begin, std::int64_t end) const {
    std::vector<double> F;
    kernels::RunOptions<T> options;
    options.every = steps_.stride;
    options.frame_F = true;
    std::ptrdiff_t next = 0;
    options.on_frame = [&](std::ptrdiff_t step, const kernels::ParticleState<T>& at) {
      for (; next < frames && steps_.step[next] == step; ++next)
        F.insert(F.end(), at.F.begin() + 9 * begin, at.F.begin() + 9 * end);
      return next < frames;
    };
    rollout.run(state, steps_.last(frames), options);
    return F;
  }

  kernels::ParticleState<T> initial(const InitialState& from) const {
    return state_of(from, all_, tracers_);
  }
  kernels::ParticleState<T> state_of(const InitialState& from, const Ensemble& e,
                                     const std::vector<double>& tracers) const {
    std::vector<double> own = observation_.start();
    own.insert(own.end(), tracers.begin(), tracers.end());
    const torch::NoGradGuard no_grad;
    const InitialFields fields = with_companions(fields_of(from, own, particles_));
    auto state = kernels::ParticleState<T>::undeformed({e.x.begin(), e.x.end()}, numbers(fields.v));
    if (fields.C.defined()) state.C = numbers(fields.C);
    if (fields.F.defined()) state.F = numbers(fields.F);
    return state;
  }
  static std::vector<T> numbers(const Tensor& t) {
    const Tensor flat = t.contiguous();
    return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
  }

  /// Where the points begin in the positions of all that is rolled out.
  const T* points_of(const std::vector<T>& x) const { return x.data() + 3 * first_point_; }

  /// Frames from states: one of them, or between it and the next one.
  Tensor at_frames(const Tensor& states, std::ptrdiff_t frames) const {
    if (!between_ && states.size(0) == frames) return states;
    const Tensor rows = states_.slice(0, 0, frames);
    const Tensor x = states.index_select(0, rows);
    if (!between_) return x;
    const Tensor share = fraction_.slice(0, 0, frames);
    const Tensor next = states.index_select(0, (rows + 1).clamp_max(states.size(0) - 1));
    return x + share * (next - x);
  }

  double frame_error(const T* x, std::ptrdiff_t frame) const {
    const double* seen = observation_.positions(frame);
    double sum = 0;
    for (std::ptrdiff_t k = 0; k < 3 * points_; ++k) {
      const double d = static_cast<double>(x[k]) - seen[k];
      if (!std::isnan(seen[k])) sum += d * d;
    }
    return sum / per_frame_;
  }

  const Observation& observation_;
  ObservedSteps steps_;
  kernels::GridSettings grid_;
  decltype(&ops::rollout) rollout_;
  std::int64_t particles_, points_;
  std::vector<Companion> companions_;
  InitialFields beside_;         // of the companions; undefined: there are none
  std::vector<double> tracers_;  // [tracers, 3] m
  Ensemble all_;
  std::int64_t first_point_;                       // row of all that the points begin with
  Tensor x0_, mass_tensor_, volume_tensor_;        // of all, in T
  std::unique_ptr<const CloudComparison> clouds_;  // of clouds, in place of what follows
  Tensor seen_;                                    // [frames, 3 points], float64
  Tensor hidden_;                                  // likewise; undefined: nothing is
  double per_frame_;
  Tensor states_, fraction_;  // [frames], [frames, 1]
  bool between_ = false;
};

/// LibTorch chooses the number of OpenMP threads anew when a thread first asks for it. It is asked
/// here, and the number that --threads chose is put back.
void keep_thread_count() {
  const int threads = omp_get_max_threads();
  at::get_num_threads();
  omp_set_num_threads(threads);
}

}  // namespace

std::unique_ptr<const MotionObjective> make_motion_objective(
    const Observation& observation, const ObservedSteps& steps, const kernels::GridSettings& grid,
    const std::string& dtype, const std::string& rollout, CloudDetail detail,
    const std::vector<Companion>& companions) {
  keep_thread_count();
  if (dtype == "float64") {
    return std::make_unique<RolloutObjective<double>>(observation, steps, grid, rollout, detail,
                                                      companions);
  }
  return std::make_unique<RolloutObjective<float>>(observation, steps, grid, rollout, detail,
                                                   companions);
}

double mean_of_first(const std::vector<double>& frame_mse, std::ptrdiff_t frames) {
  double sum = 0;
  for (std::ptrdiff_t f = 0; f < frames; ++f) sum += frame_mse[f];
  return sum / static_cast<double>(frames);
}

}  // namespace uniphy
