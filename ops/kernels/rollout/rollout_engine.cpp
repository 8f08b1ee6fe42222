#include "ops/kernels/rollout/rollout_engine.hpp"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/team_barrier.hpp"
#include "ops/kernels/rollout/lost_particle.hpp"
#include "ops/kernels/simd/prefetch.hpp"

namespace uniphy::kernels {
namespace {

template <class T>
std::vector<ParticleRange> ranges_of(const Rollout<T>& rollout) {
  std::vector<ParticleRange> ranges;
  for (const auto& body : rollout.bodies()) ranges.emplace_back(body.begin, body.end);
  return ranges;
}

}  // namespace

template <class T>
RolloutEngine<T>::RolloutEngine(const Rollout<T>& rollout)
    : rollout_(rollout),
      table_(mpm_table<T>()),
      constants_(rollout.grid()),
      order_(ranges_of(rollout)),
      mass_(chunks() * std::ptrdiff_t(kChunk)),
      volume_(chunks() * std::ptrdiff_t(kChunk)),
      states_(chunks() * std::ptrdiff_t(kStateChunkSize), Pages::huge),
      keep_memory_(rollout.has_memory()),
      transfer_(chunks(), Pages::huge),
      grid_nodes_(grid_size(rollout.grid().n)),
      accumulator_(order_.bodies()),
      sum_count_(order_.bodies(), 0),
      sum_start_(order_.bodies(), 0),
      weight_sum_(order_.bodies()) {
  transfer_.fill(TransferChunk<T>{});
}

template <class T>
int RolloutEngine<T>::threads() const {
  return std::max(1, std::min(omp_get_max_threads(), chunks() / 2));
}

template <class T>
void RolloutEngine<T>::load(const ParticleState<T>& state, std::ptrdiff_t history,
                            const T* sort_x) {
  keep_history_ = history > 0;
  kept_steps_ = 0;
  state_stride_ = keep_history_ ? chunks() * std::ptrdiff_t(kStateChunkSize) : 0;
  states_.resize((history + 1) * chunks() * kStateChunkSize);
  if (keep_history_) stresses_.resize(history * chunks() * kMatrixChunkSize);
  if (std::ptrdiff_t(records_.size()) < history) records_.resize(history);

  order_.sort(sort_x != nullptr ? sort_x : state.x.data(), rollout_.grid().n);
  order_.load(rollout_.mass().data(), 1, mass_.data(), kChunk);
  order_.load(rollout_.volume().data(), 1, volume_.data(), kChunk);
  T* planes = states_.data();
  order_.load(state.x.data(), 3, planes + kPlaneX * kChunk, kStateChunkSize);
  order_.load(state.v.data(), 3, planes + kPlaneV * kChunk, kStateChunkSize);
  order_.load(state.C.data(), 9, planes + kPlaneC * kChunk, kStateChunkSize);
  order_.load(state.F.data(), 9, planes + kPlaneF * kChunk, kStateChunkSize);
  if (keep_memory_)
    order_.load(state.memory.data(), 1, planes + kPlaneMemory * kChunk, kStateChunkSize);
}

template <class T>
void RolloutEngine<T>::store(ParticleState<T>& state) const {
  const T* planes = states_.data() + kept_steps_ * state_stride_;
  const auto put = [&](int plane, int width, std::vector<T>& rows) {
    if (!rows.empty()) order_.store(planes + plane * kChunk, kStateChunkSize, width, rows.data());
  };
  put(kPlaneX, 3, state.x);
  put(kPlaneV, 3, state.v);
  put(kPlaneC, 9, state.C);
  put(kPlaneF, 9, state.F);
  if (keep_memory_) put(kPlaneMemory, 1, state.memory);
}

template <class T>
void RolloutEngine<T>::begin_step(int chunk, std::ptrdiff_t s) {
  alignas(64) T scratch_F[kMatrixChunkSize], scratch_tau[kMatrixChunkSize];
  const T* from = state(s, chunk);
  T* to = state(s + 1, chunk);
  T* F_trial =
      keep_F_trial_ ? F_trials_.data() + chunk * std::ptrdiff_t(kMatrixChunkSize) : scratch_F;
  T* tau = keep_history_ || keep_F_trial_ ? stress(s, chunk) : scratch_tau;
  const int count = order_.count(chunk);
  const int next = after(chunk);
  table_.deformation_update(from, count, constants_, F_trial);
  prefetch(state(s, next) + kPlaneF * kChunk, kMatrixChunkSize * sizeof(T));
  LawMemory<T> memory;
  if (law_has_memory(chunk)) {
    memory = {plane_view<const T>(from + kPlaneMemory * kChunk),
              plane_view(to + kPlaneMemory * kChunk)};
  } else if (keep_memory_ && keep_history_) {
    std::copy_n(from + kPlaneMemory * kChunk, kChunk, to + kPlaneMemory * kChunk);
  }
  rollout_.bodies()[order_.body(chunk)].law->evaluate(
      count, constants_.dt, plane_view<const T>(F_trial),
      plane_view<const T>(from + kPlaneC * kChunk), plane_view(to + kPlaneF * kChunk),
      plane_view(tau), memory);
  prefetch(transfer_[next].record, sizeof(transfer_[next].record));
  table_.p2g_records(from, tau, mass(chunk), volume(chunk), constants_, &transfer_[chunk]);
}

template <class T>
void RolloutEngine<T>::transfer_layers(std::ptrdiff_t s, int part, int parts) {
  const int begin = plan_.cut(part, parts), end = plan_.cut(part + 1, parts);
  if (begin >= end) return;
  const GridView<T> grid = grid_view(grid_nodes_.data(), constants_.n);
  for (int i = begin; i < end; ++i) clear_layer(grid, i, plan_.box(i));
  for (int c = 0; c < chunks(); ++c) {
    if (c + 1 < chunks()) prefetch_stencil(transfer_[c + 1]);
    table_.scatter(transfer_[c], grid, begin, end);
  }
  for (int i = begin; i < end; ++i) {
    table_.grid_update(grid, i, plan_.box(i), constants_);
    if (keep_history_) {
      save_layer(grid, i, plan_.box(i), records_[s].nodes.data() + 4 * plan_.offset(i));
    }
  }
}

template <class T>
void RolloutEngine<T>::end_step(int chunk, std::ptrdiff_t s) {
  alignas(64) T moments[kGatherPlanes * kChunk];
  const int next = after(chunk);
  TransferChunk<T>& transfer = transfer_[chunk];
  const T* from = state(s, chunk);
  T* to = state(s + 1, chunk);
  prefetch_stencil(transfer_[next]);
  table_.gather(transfer, grid_view<const T>(grid_nodes_.data(), constants_.n), moments);
  prefetch(state(s, next), kPlaneF * kChunk * sizeof(T));
  table_.g2p_finish(transfer, moments, from, constants_, to);
  table_.stencil(to, order_.count(chunk), constants_, &transfer);
}

template <class T>
void RolloutEngine<T>::advance(std::ptrdiff_t first_step, std::ptrdiff_t steps) {
  // Set by one thread between two barriers, read by all after them.
  bool lost = false;
  std::ptrdiff_t done = 0;
  TeamBarrier barrier;
#pragma omp parallel num_threads(threads())
  {
    const int part = omp_get_thread_num(), parts = omp_get_num_threads();
    for_chunks(part, parts, [&](int c) {
      table_.stencil(state(0, c), order_.count(c), constants_, &transfer_[c]);
      begin_step(c, 0);
    });
    for (std::ptrdiff_t s = 0; s < steps; ++s) {
      barrier.wait(parts);
      if (part == 0) {
        done = s;
        for (int c = 0; c < chunks(); ++c) lost = lost || transfer_[c].bad >= 0;
        if (!lost) {
          plan_.build(transfer_.data(), chunks(), constants_.n);
          if (keep_history_) {
            records_[s].plan = plan_;
            records_[s].nodes.resize(4 * plan_.nodes());
          }
        }
      }
      barrier.wait(parts);
      if (lost) break;
      transfer_layers(s, part, parts);
      barrier.wait(parts);
      for_chunks(part, parts, [&](int c) {
        end_step(c, s);
        if (s + 1 < steps) begin_step(c, s + 1);
      });
    }
    barrier.wait(parts);  // so that nobody waits in the barrier of libgomp
  }
  kept_steps_ = lost ? done : steps;
  throw_if_lost(first_step + kept_steps_);
}

template <class T>
void RolloutEngine<T>::advance_sampled(std::ptrdiff_t step, LawSample<T>& sample) {
  const std::ptrdiff_t rows = 9 * order_.particles();
  for (std::vector<T>* v : {&sample.F_trial, &sample.F_proj, &sample.C, &sample.tau}) {
    v->resize(rows);
  }
  F_trials_.resize(chunks() * std::ptrdiff_t(kMatrixChunkSize));
  stresses_.resize(chunks() * std::ptrdiff_t(kMatrixChunkSize));
  order_.store(states_.data() + kPlaneC * kChunk, kStateChunkSize, 9, sample.C.data());
  keep_F_trial_ = true;
  advance(step, 1);
  keep_F_trial_ = false;
  order_.store(F_trials_.data(), kMatrixChunkSize, 9, sample.F_trial.data());
  order_.store(stresses_.data(), kMatrixChunkSize, 9, sample.tau.data());
  order_.store(states_.data() + kPlaneF * kChunk, kStateChunkSize, 9, sample.F_proj.data());
}

template <class T>
void RolloutEngine<T>::throw_if_lost(std::ptrdiff_t step) {
  std::ptrdiff_t particle = -1;
  double x[3] = {0, 0, 0}, speed = 0;
  for (int c = 0; c < chunks(); ++c) {
    if (transfer_[c].bad < 0) continue;
    const T* planes = state(kept_steps_, c);
    const int l = transfer_[c].bad;
    const std::ptrdiff_t p = order_.particles_of(c)[l];
    if (particle >= 0 && p > particle) continue;
    particle = p;
    double squared = 0;
    for (int a = 0; a < 3; ++a) {
      x[a] = planes[(kPlaneX + a) * kChunk + l];
      const double v = planes[(kPlaneV + a) * kChunk + l];
      squared += v * v;
    }
    speed = std::sqrt(squared);
  }
  if (particle < 0) return;
  const GridSettings& grid = rollout_.grid();
  const bool finite = std::isfinite(x[0] + x[1] + x[2]);
  const double cells = speed * grid.dt / grid.dx();
  const char* cause =
      "the body came too close to the border of the grid, or the walls (bound) are "
      "too thin for its speed";
  if (step == 0) {
    cause = "the body is placed too close to the border of the grid, or outside it";
  } else if (!finite || !(cells < 0.5)) {
    cause = "the time step is too large for the stiffness or the viscosity of the material";
  }
  char text[512];
  std::snprintf(
      text, sizeof(text),
      "particle %td at (%.6g, %.6g, %.6g) m %s after step %td (speed %.4g m/s, %.3g cells "
      "a step); expected positions in [%.6g, %.6g) m; likely cause: %s",
      particle, x[0], x[1], x[2], finite ? "left the grid" : "is not finite", step, speed, cells,
      0.5 * grid.dx(), 1 - 1.5 * grid.dx(), cause);
  throw LostParticle(text, particle, step);
}

template class RolloutEngine<float>;
template class RolloutEngine<double>;

}  // namespace uniphy::kernels
