#pragma once

// Inside of a roll-out: its particles in chunks, and the loops over steps.

#include <algorithm>
#include <vector>

#include "ops/kernels/mpm/grid_plan.hpp"
#include "ops/kernels/mpm/mpm_table.hpp"
#include "ops/kernels/mpm/particle_order.hpp"
#include "ops/kernels/rollout/rollout.hpp"
#include "ops/kernels/simd/aligned_buffer.hpp"

namespace uniphy::kernels {

/// One step as the backward pass needs it again: the touched grid after its update.
template <class T>
struct GridRecord {
  GridPlan plan;
  AlignedBuffer<T> nodes;
};

template <class T>
class RolloutEngine {
 public:
  explicit RolloutEngine(const Rollout<T>& rollout);

  /// Sorts the particles by cell and takes over their state. With history > 0 the next advance(),
  /// of at most that many steps, keeps every state, stress and grid for backward(); else states
  /// are advanced in place. sort_x [P,3]: what they are sorted by; null: state.x.
  void load(const ParticleState<T>& state, std::ptrdiff_t history = 0, const T* sort_x = nullptr);
  /// Back to the user's order; vectors of the right size, empty ones are left out.
  void store(ParticleState<T>& state) const;

  /// `steps` steps; the number of the first is for error messages.
  void advance(std::ptrdiff_t first_step, std::ptrdiff_t steps);
  /// The same for one step, with what the law saw.
  void advance_sampled(std::ptrdiff_t step, LawSample<T>& sample);

  /// Says of each body whether backward() adds to its sum of the weights; empty: of none.
  void want_weights(const std::vector<bool>& bodies);

  /// dL/d(frames) as the backward pass adds them: frame f belongs to state f·every.
  struct FrameGradients {
    const T* x = nullptr;
    const T* v = nullptr;
    std::ptrdiff_t every = 1;
  };
  /// Takes over dL/d(state after the last kept step), walks back through the kept steps and adds
  /// the gradients of the frames of states first_step … first_step + steps − 1. Adds to the
  /// accumulators of the laws.
  void backward(ParticleState<T>& grad, std::ptrdiff_t first_step, const FrameGradients& frames);
  /// Summed accumulator of a body so far.
  const std::vector<double>& accumulator(int body) const { return accumulator_[body]; }
  /// Summed gradients of the weights of a body so far (LawKernel::weight_sums_size numbers).
  const std::vector<double>& weight_sum(int body) const { return weight_sum_[body]; }

 private:
  T* state(std::ptrdiff_t s, int chunk) {
    return states_.data() + (s * state_stride_ + chunk * std::ptrdiff_t(kStateChunkSize));
  }
  T* stress(std::ptrdiff_t s, int chunk) {
    return stresses_.data() + (s * chunks() + chunk) * std::ptrdiff_t(kMatrixChunkSize);
  }
  T* mass(int chunk) { return mass_.data() + chunk * std::ptrdiff_t(kChunk); }
  T* volume(int chunk) { return volume_.data() + chunk * std::ptrdiff_t(kChunk); }
  int chunks() const { return order_.chunks(); }
  /// The chunk to prefetch while at work on `chunk`.
  int after(int chunk) const { return std::min(chunk + 1, chunks() - 1); }
  /// Calls visit(chunk) for the share of thread `part` of `parts`: an equal part of every body,
  /// since laws differ in cost.
  template <class Visit>
  void for_chunks(int part, int parts, const Visit& visit) const;
  /// The same split that leaves the chunks of one running sum of the weights to one thread.
  template <class Visit>
  void for_chunks_backward(int part, int parts, const Visit& visit) const;
  int threads() const;
  void throw_if_lost(std::ptrdiff_t step);

  bool law_has_memory(int chunk) const {
    return rollout_.bodies()[order_.body(chunk)].law->has_memory();
  }

  void begin_step(int chunk, std::ptrdiff_t s);
  void transfer_layers(std::ptrdiff_t s, int part, int parts);
  void end_step(int chunk, std::ptrdiff_t s);
  void begin_backward_step(int chunk, std::ptrdiff_t s);
  void transfer_layers_backward(std::ptrdiff_t s, int part, int parts);
  void end_backward_step(int chunk, std::ptrdiff_t s);
  T* weight_sums_of(int chunk);
  void add_frame(int chunk, const T* rows, int plane);

  const Rollout<T>& rollout_;
  const MpmTable<T>& table_;
  const StepConstants<T> constants_;
  ParticleOrder order_;

  AlignedBuffer<T> mass_, volume_;  ///< [chunks][kChunk]
  AlignedBuffer<T> states_;         ///< [steps + 1 or 1][chunks][kStatePlanes][kChunk]
  std::ptrdiff_t state_stride_ = 0;
  AlignedBuffer<T> stresses_{0, Pages::huge},
      F_trials_;  ///< [steps][chunks][9][kChunk], where kept
  bool keep_history_ = false, keep_F_trial_ = false;
  const bool keep_memory_;  ///< some body has one
  AlignedBuffer<TransferChunk<T>> transfer_;
  AlignedBuffer<T> grid_nodes_, grad_nodes_;
  GridPlan plan_;
  std::vector<GridRecord<T>> records_;
  std::ptrdiff_t kept_steps_ = 0;

  AlignedBuffer<T> grads_{0, Pages::huge};  ///< [chunks][kStatePlanes][kChunk]
  AlignedBuffer<T> accumulators_;           ///< of chunk c from accumulator_start_[c] on
  std::vector<std::ptrdiff_t> accumulator_start_;
  std::vector<std::vector<double>> accumulator_;

  /// The chunks of a body are dealt, in order, to this many running sums of its weights; 0: none.
  std::vector<int> sum_count_;
  std::vector<std::ptrdiff_t> sum_start_;  ///< of the first one of a body
  AlignedBuffer<T> weight_sums_{0, Pages::huge};
  std::vector<std::vector<double>> weight_sum_;
};

template <class T>
template <class Visit>
void RolloutEngine<T>::for_chunks(int part, int parts, const Visit& visit) const {
  for (int b = 0; b < order_.bodies(); ++b) {
    const std::ptrdiff_t first = order_.first_chunk(b), n = order_.first_chunk(b + 1) - first;
    for (std::ptrdiff_t c = first + n * part / parts; c < first + n * (part + 1) / parts; ++c) {
      visit(static_cast<int>(c));
    }
  }
}

template <class T>
template <class Visit>
void RolloutEngine<T>::for_chunks_backward(int part, int parts, const Visit& visit) const {
  for (int b = 0; b < order_.bodies(); ++b) {
    const std::ptrdiff_t first = order_.first_chunk(b), n = order_.first_chunk(b + 1) - first;
    // A unit is a chunk, or all chunks of a running sum.
    const std::ptrdiff_t units = sum_count_[b] > 0 ? sum_count_[b] : n;
    for (std::ptrdiff_t c = n * (units * part / parts) / std::max<std::ptrdiff_t>(units, 1);
         c < n * (units * (part + 1) / parts) / std::max<std::ptrdiff_t>(units, 1); ++c) {
      visit(static_cast<int>(first + c));
    }
  }
}

}  // namespace uniphy::kernels
