#include <omp.h>

#include <algorithm>

#include "ops/kernels/base/team_barrier.hpp"
#include "ops/kernels/rollout/rollout_engine.hpp"
#include "ops/kernels/simd/prefetch.hpp"

namespace uniphy::kernels {

// One step backwards, from dL/d(state s + 1) in grads_ to dL/d(state s):
//   begin_backward_step       records of the adjoint of G2P
//   transfer_layers_backward  their scatter, the kept grid back in place, the adjoint grid update
//   end_backward_step         both gathers, then the law and the deformation update
// with the same division of work, and the same two kinds of loops, as forwards.

namespace {

/// Running sums of the weights of one body, whatever the number of threads, so that there is one
/// order of summation; at least two chunks for each, as for a thread. At the published size (4x128)
/// one has 0.44 MB in float32.
constexpr int kWeightSums = 16;

/// The sum of chunk c of n: c with n·k/sums ≤ c < n·(k + 1)/sums belong to sum k.
std::ptrdiff_t sum_of(std::ptrdiff_t c, std::ptrdiff_t n, std::ptrdiff_t sums) {
  return ((c + 1) * sums - 1) / n;
}

}  // namespace

template <class T>
void RolloutEngine<T>::want_weights(const std::vector<bool>& bodies) {
  std::ptrdiff_t size = 0;
  for (int b = 0; b < order_.bodies(); ++b) {
    const std::ptrdiff_t n = order_.first_chunk(b + 1) - order_.first_chunk(b);
    const bool wanted = !bodies.empty() && bodies[b] && n > 0;
    sum_count_[b] =
        wanted ? static_cast<int>(std::clamp<std::ptrdiff_t>(n / 2, 1, kWeightSums)) : 0;
    sum_start_[b] = size;
    if (!wanted) continue;
    weight_sum_[b].assign(rollout_.bodies()[b].law->weight_sums_size(), 0.0);
    size += sum_count_[b] * rollout_.bodies()[b].law->weight_sums_size();
  }
  weight_sums_.resize(size);
}

template <class T>
T* RolloutEngine<T>::weight_sums_of(int chunk) {
  const int b = order_.body(chunk);
  if (sum_count_[b] == 0) return nullptr;
  const std::ptrdiff_t first = order_.first_chunk(b), n = order_.first_chunk(b + 1) - first;
  return weight_sums_.data() + sum_start_[b] +
         sum_of(chunk - first, n, sum_count_[b]) * rollout_.bodies()[b].law->weight_sums_size();
}

template <class T>
void RolloutEngine<T>::begin_backward_step(int chunk, std::ptrdiff_t s) {
  TransferChunk<T>& transfer = transfer_[chunk];
  table_.stencil(state(s, chunk), order_.count(chunk), constants_, &transfer);
  table_.g2p_adjoint_records(grads_.data() + chunk * std::ptrdiff_t(kStateChunkSize), constants_,
                             &transfer);
}

template <class T>
void RolloutEngine<T>::transfer_layers_backward(std::ptrdiff_t s, int part, int parts) {
  const GridRecord<T>& record = records_[s];
  const GridPlan& plan = record.plan;
  const int begin = plan.cut(part, parts), end = plan.cut(part + 1, parts);
  if (begin >= end) return;
  const GridView<T> grid = grid_view(grid_nodes_.data(), constants_.n);
  const GridView<T> grad = grid_view(grad_nodes_.data(), constants_.n);
  for (int i = begin; i < end; ++i) clear_layer(grad, i, plan.box(i));
  for (int c = 0; c < chunks(); ++c) {
    if (c + 1 < chunks()) prefetch_stencil(transfer_[c + 1]);
    table_.scatter(transfer_[c], grad, begin, end);
  }
  for (int i = begin; i < end; ++i) {
    restore_layer(grid, i, plan.box(i), record.nodes.data() + 4 * plan.offset(i));
    table_.grid_update_adjoint({grid.data, grid.row_stride, grid.layer_stride}, grad, i,
                               plan.box(i), constants_);
  }
}

template <class T>
void RolloutEngine<T>::end_backward_step(int chunk, std::ptrdiff_t s) {
  alignas(64) T moments[kGatherAdjointPlanes * kChunk];
  alignas(64) T grad_tau[kMatrixChunkSize], F_trial[kMatrixChunkSize];
  const int count = order_.count(chunk);
  TransferChunk<T>& transfer = transfer_[chunk];
  const T* from = state(s, chunk);
  T* grad = grads_.data() + chunk * std::ptrdiff_t(kStateChunkSize);
  const GridView<const T> grid = grid_view<const T>(grid_nodes_.data(), constants_.n);
  const GridView<const T> grad_grid = grid_view<const T>(grad_nodes_.data(), constants_.n);
  const int next = after(chunk);

  prefetch_stencil(transfer_[next]);
  prefetch(state(s + 1, next) + kPlaneV * kChunk, 3 * kChunk * sizeof(T));
  table_.gather_slopes(transfer, grid, moments);
  prefetch(grads_.data() + next * std::ptrdiff_t(kStateChunkSize), kStateChunkSize * sizeof(T));
  table_.g2p_adjoint_finish(transfer, moments, state(s + 1, chunk) + kPlaneV * kChunk, constants_,
                            grad);
  table_.p2g_records(from, stress(s, chunk), mass(chunk), volume(chunk), constants_, &transfer);
  prefetch(state(s, next), kStateChunkSize * sizeof(T));
  table_.gather_adjoint(transfer, grad_grid, moments);
  prefetch(stress(s, next), kMatrixChunkSize * sizeof(T));
  table_.p2g_adjoint_finish(transfer, moments, mass(chunk), volume(chunk), constants_, grad,
                            grad_tau);

  if (s > 0) prefetch(state(s - 1, next) + kPlaneX * kChunk, 3 * kChunk * sizeof(T));
  table_.deformation_update(from, count, constants_, F_trial);
  T* grad_F = grad + kPlaneF * kChunk;
  T* grad_C = grad + kPlaneC * kChunk;
  LawMemoryAdjoint<T> memory;
  if (law_has_memory(chunk)) {
    T* grad_memory = grad + kPlaneMemory * kChunk;
    memory = {plane_view<const T>(from + kPlaneMemory * kChunk), plane_view<const T>(grad_memory),
              plane_view(grad_memory)};
  }
  rollout_.bodies()[order_.body(chunk)].law->adjoint(
      count, constants_.dt, plane_view<const T>(F_trial),
      plane_view<const T>(from + kPlaneC * kChunk), plane_view<const T>(grad_F),
      plane_view<const T>(grad_tau), plane_view(grad_F), plane_view(grad_C),
      accumulators_.data() + accumulator_start_[chunk], weight_sums_of(chunk), memory);
  table_.deformation_update_adjoint(from, count, constants_, grad_F, grad_C, grad_F);
}

template <class T>
void RolloutEngine<T>::add_frame(int chunk, const T* rows, int plane) {
  const std::int32_t* particle = order_.particles_of(chunk);
  T* grad = grads_.data() + chunk * std::ptrdiff_t(kStateChunkSize) + plane * kChunk;
  for (int l = 0; l < order_.count(chunk); ++l) {
    for (int a = 0; a < 3; ++a) grad[a * kChunk + l] += rows[3 * std::ptrdiff_t(particle[l]) + a];
  }
}

template <class T>
void RolloutEngine<T>::backward(ParticleState<T>& grad, std::ptrdiff_t first_step,
                                const FrameGradients& frames) {
  grads_.resize(chunks() * std::ptrdiff_t(kStateChunkSize));
  grad_nodes_.resize(grid_size(constants_.n));
  accumulator_start_.assign(chunks() + 1, 0);
  for (int c = 0; c < chunks(); ++c) {
    accumulator_start_[c + 1] =
        accumulator_start_[c] + rollout_.bodies()[order_.body(c)].law->accumulator_size();
  }
  accumulators_.resize(accumulator_start_.back());
  accumulators_.fill(T(0));
  weight_sums_.fill(T(0));
  order_.load(grad.x.data(), 3, grads_.data() + kPlaneX * kChunk, kStateChunkSize);
  order_.load(grad.v.data(), 3, grads_.data() + kPlaneV * kChunk, kStateChunkSize);
  order_.load(grad.C.data(), 9, grads_.data() + kPlaneC * kChunk, kStateChunkSize);
  order_.load(grad.F.data(), 9, grads_.data() + kPlaneF * kChunk, kStateChunkSize);
  if (keep_memory_)
    order_.load(grad.memory.data(), 1, grads_.data() + kPlaneMemory * kChunk, kStateChunkSize);

  TeamBarrier barrier;
#pragma omp parallel num_threads(threads())
  {
    const int part = omp_get_thread_num(), parts = omp_get_num_threads();
    if (kept_steps_ > 0) {
      for_chunks_backward(part, parts, [&](int c) { begin_backward_step(c, kept_steps_ - 1); });
    }
    for (std::ptrdiff_t s = kept_steps_ - 1; s >= 0; --s) {
      barrier.wait(parts);
      transfer_layers_backward(s, part, parts);
      barrier.wait(parts);
      const std::ptrdiff_t step = first_step + s, frame = step / frames.every;
      const std::ptrdiff_t at = frame * 3 * order_.particles();
      const bool is_frame = step % frames.every == 0;
      for_chunks_backward(part, parts, [&](int c) {
        end_backward_step(c, s);
        if (is_frame && frames.x != nullptr) add_frame(c, frames.x + at, kPlaneX);
        if (is_frame && frames.v != nullptr) add_frame(c, frames.v + at, kPlaneV);
        if (s > 0) begin_backward_step(c, s - 1);
      });
    }
    barrier.wait(parts);
  }

  order_.store(grads_.data() + kPlaneX * kChunk, kStateChunkSize, 3, grad.x.data());
  order_.store(grads_.data() + kPlaneV * kChunk, kStateChunkSize, 3, grad.v.data());
  order_.store(grads_.data() + kPlaneC * kChunk, kStateChunkSize, 9, grad.C.data());
  order_.store(grads_.data() + kPlaneF * kChunk, kStateChunkSize, 9, grad.F.data());
  if (keep_memory_)
    order_.store(grads_.data() + kPlaneMemory * kChunk, kStateChunkSize, 1, grad.memory.data());
  for (int c = 0; c < chunks(); ++c) {
    std::vector<double>& sum = accumulator_[order_.body(c)];
    const std::ptrdiff_t begin = accumulator_start_[c], size = accumulator_start_[c + 1] - begin;
    sum.resize(size, 0);
    for (std::ptrdiff_t k = 0; k < size; ++k) sum[k] += accumulators_[begin + k];
  }
  for (int b = 0; b < order_.bodies(); ++b) {
    std::vector<double>& sum = weight_sum_[b];
    const T* from = weight_sums_.data() + sum_start_[b];
    for (int s = 0; s < sum_count_[b]; ++s)
      for (double& number : sum) number += *from++;
  }
}

template class RolloutEngine<float>;
template class RolloutEngine<double>;

}  // namespace uniphy::kernels
