#include "ops/kernels/rollout/rollout.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "ops/kernels/base/between_steps.hpp"
#include "ops/kernels/base/check_positive.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/tracer.hpp"
#include "ops/kernels/rollout/rollout_engine.hpp"

namespace uniphy::kernels {
namespace {

/// Particles are sorted by cell again after this many steps. The order of summation, hence the
/// bits, depends on it, so it must not depend on where frames are taken.
constexpr std::ptrdiff_t kSortEvery = 32;

template <class T>
void check_size(const char* name, const std::vector<T>& values, std::ptrdiff_t expected) {
  if (static_cast<std::ptrdiff_t>(values.size()) == expected) return;
  throw Error(std::string("roll-out: expected ") + std::to_string(expected) + " numbers in " +
              name + ", found " + std::to_string(values.size()));
}

template <class T>
void check_state(const ParticleState<T>& state, std::ptrdiff_t particles) {
  check_size("x", state.x, 3 * particles);
  check_size("v", state.v, 3 * particles);
  check_size("C", state.C, 9 * particles);
  check_size("F", state.F, 9 * particles);
  if (!state.memory.empty()) check_size("memory", state.memory, particles);
}

void check_steps(std::ptrdiff_t steps, std::ptrdiff_t every, std::ptrdiff_t least_every) {
  if (steps < 0) throw Error("roll-out: expected steps >= 0, found " + std::to_string(steps));
  if (every < least_every) {
    throw Error("roll-out: expected every >= " + std::to_string(least_every) + ", found " +
                std::to_string(every));
  }
}

template <class T>
void check_tracers(const std::vector<T>& mass, const std::vector<T>& volume, std::ptrdiff_t begin,
                   std::ptrdiff_t end) {
  for (std::ptrdiff_t p = begin; p < end; ++p) {
    if (mass[p] == 0 && volume[p] == 0) continue;
    throw Error("roll-out: expected mass 0 and volume 0 of particle " + std::to_string(p) +
                ", a tracer, found " + std::to_string(mass[p]) + " kg and " +
                std::to_string(volume[p]) + " m^3");
  }
}

}  // namespace

template <class T>
Rollout<T>::Rollout(const GridSettings& grid, std::vector<BodyRange<T>> bodies, std::vector<T> mass,
                    std::vector<T> volume)
    : grid_(grid), bodies_(std::move(bodies)), mass_(std::move(mass)), volume_(std::move(volume)) {
  grid_.check();
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    if (bodies_[b].law == nullptr) throw Error("body " + std::to_string(b) + " has no law");
  }
  const std::ptrdiff_t expected = bodies_.empty() ? 0 : bodies_.back().end;
  check_size("mass", mass_, expected);
  check_size("volume", volume_, expected);
  std::vector<ParticleRange> ranges;
  for (const auto& body : bodies_) ranges.emplace_back(body.begin, body.end);
  ParticleOrder{ranges};  // refuses ranges that do not fit
  for (const auto& body : bodies_) {
    if (is_tracer(*body.law)) {
      check_tracers(mass_, volume_, body.begin, body.end);
    } else {
      check_positive("roll-out", "mass", mass_.data(), body.begin, body.end);
      check_positive("roll-out", "volume", volume_.data(), body.begin, body.end);
    }
  }
}

template <class T>
bool Rollout<T>::has_memory() const {
  return std::any_of(bodies_.begin(), bodies_.end(),
                     [](const auto& body) { return body.law->has_memory(); });
}

template <class T>
std::ptrdiff_t Rollout<T>::run(ParticleState<T>& state, std::ptrdiff_t steps,
                               const RunOptions<T>& options) const {
  check_state(state, particles());
  check_steps(steps, options.every, 0);
  if (has_memory()) state.memory.resize(particles(), T(0));
  const bool frames = options.every > 0 && options.on_frame;
  ParticleState<T> frame;
  frame.x.resize(3 * particles());
  if (options.frame_v) frame.v.resize(3 * particles());
  if (options.frame_C) frame.C.resize(9 * particles());
  if (options.frame_F) frame.F.resize(9 * particles());
  const bool samples = options.sample_step && options.on_sample;
  LawSample<T> sample;

  RolloutEngine<T> engine(*this);
  SortState<T> own;
  SortState<T>& sort = options.sort != nullptr ? *options.sort : own;
  const auto sort_now = [&] {
    sort = {0, state.x};
    engine.load(state);
  };
  if (sort.steps <= 0 || sort.steps >= kSortEvery) {
    sort_now();
  } else {
    check_size("sort", sort.x, 3 * particles());
    engine.load(state, 0, sort.x.data());
  }
  std::ptrdiff_t done = 0;
  while (true) {
    if (frames && done % options.every == 0) {
      engine.store(frame);
      if (!options.on_frame(options.first_step + done, frame)) break;
    }
    if (done == steps) break;
    call_between_steps();
    if (sort.steps == kSortEvery) {
      engine.store(state);
      sort_now();
    }
    std::ptrdiff_t until = std::min(steps, done + kSortEvery - sort.steps);
    if (frames) until = std::min(until, (done / options.every + 1) * options.every);
    const std::ptrdiff_t step = options.first_step + done;
    if (samples && options.sample_step(step)) {
      engine.advance_sampled(step, sample);
      options.on_sample(step, sample);
      ++done;
      ++sort.steps;
      continue;
    }
    std::ptrdiff_t next = done + 1;
    while (next < until && !(samples && options.sample_step(options.first_step + next))) ++next;
    engine.advance(step, next - done);
    sort.steps += next - done;
    done = next;
  }
  engine.store(state);
  return done;
}

template <class T>
void Rollout<T>::record(const ParticleState<T>& initial, std::ptrdiff_t steps, std::ptrdiff_t every,
                        T* frames_x, T* frames_v, RolloutTape<T>* tape) const {
  check_state(initial, particles());
  check_steps(steps, every, 1);
  // Segments of about sqrt(steps), in multiples of kSortEvery: then most roll-outs have the bits of
  // run().
  const double root = std::sqrt(static_cast<double>(steps));
  const std::ptrdiff_t segment =
      kSortEvery * std::max<std::ptrdiff_t>(1, std::lround(std::ceil(root / kSortEvery)));
  if (tape != nullptr) *tape = RolloutTape<T>{steps, every, segment, {}};

  RolloutEngine<T> engine(*this);
  ParticleState<T> state = initial, frame;
  if (has_memory()) state.memory.resize(particles(), T(0));
  for (std::ptrdiff_t done = 0;;) {
    if (done % segment == 0) {
      if (done > 0) engine.store(state);
      engine.load(state);
      if (tape != nullptr && done < steps) tape->checkpoints.push_back(state);
    }
    if (done % every == 0) {
      frame.x.resize(3 * particles());
      if (frames_v != nullptr) frame.v.resize(3 * particles());
      engine.store(frame);
      const std::ptrdiff_t at = done / every * 3 * particles();
      std::copy(frame.x.begin(), frame.x.end(), frames_x + at);
      if (frames_v != nullptr) std::copy(frame.v.begin(), frame.v.end(), frames_v + at);
    }
    if (done == steps) break;
    call_between_steps();
    const std::ptrdiff_t until =
        std::min({steps, (done / segment + 1) * segment, (done / every + 1) * every});
    engine.advance(done, until - done);
    done = until;
  }
}

template <class T>
RolloutGradient<T> Rollout<T>::adjoint(const RolloutTape<T>& tape, const T* grad_x, const T* grad_v,
                                       const std::vector<bool>& of_weights) const {
  if (!of_weights.empty() && of_weights.size() != bodies_.size()) {
    throw Error("roll-out: expected " + std::to_string(bodies_.size()) + " bodies in of_weights, " +
                "found " + std::to_string(of_weights.size()));
  }
  RolloutGradient<T> result;
  ParticleState<T>& grad = result.state;
  grad.x.assign(3 * particles(), T(0));
  grad.v.assign(3 * particles(), T(0));
  grad.C.assign(9 * particles(), T(0));
  grad.F.assign(9 * particles(), T(0));
  if (has_memory()) grad.memory.assign(particles(), T(0));
  if (tape.steps % tape.every == 0) {
    const std::ptrdiff_t at = tape.steps / tape.every * 3 * particles();
    if (grad_x != nullptr) std::copy_n(grad_x + at, 3 * particles(), grad.x.begin());
    if (grad_v != nullptr) std::copy_n(grad_v + at, 3 * particles(), grad.v.begin());
  }

  RolloutEngine<T> engine(*this);
  engine.want_weights(of_weights);
  const typename RolloutEngine<T>::FrameGradients frames{grad_x, grad_v, tape.every};
  for (std::ptrdiff_t k = static_cast<std::ptrdiff_t>(tape.checkpoints.size()) - 1; k >= 0; --k) {
    call_between_steps();
    const std::ptrdiff_t first = k * tape.segment;
    const std::ptrdiff_t steps = std::min(tape.segment, tape.steps - first);
    engine.load(tape.checkpoints[k], steps);
    engine.advance(first, steps);
    engine.backward(grad, first, frames);
  }
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const std::vector<double>& sum = engine.accumulator(static_cast<int>(b));
    const LawKernel<T>& law = *bodies_[b].law;
    std::vector<T> accumulator(sum.begin(), sum.end());
    accumulator.resize(law.accumulator_size(), T(0));
    result.parameters.emplace_back(law.parameter_size(), T(0));
    law.parameter_gradient(accumulator.data(), result.parameters.back().data());
    result.weights.emplace_back();
    if (of_weights.empty() || !of_weights[b]) continue;
    const std::vector<double>& weight_sum = engine.weight_sum(static_cast<int>(b));
    AlignedBuffer<T> weight_sums(law.weight_sums_size());
    weight_sums.fill(T(0));
    std::copy(weight_sum.begin(), weight_sum.end(), weight_sums.data());
    result.weights.back().resize(law.weight_size());
    law.weight_gradient(accumulator.data(), weight_sums.data(), result.weights.back().data());
  }
  return result;
}

template class Rollout<float>;
template class Rollout<double>;

}  // namespace uniphy::kernels
