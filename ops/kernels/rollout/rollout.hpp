#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/mpm/grid.hpp"
#include "ops/kernels/mpm/particle_state.hpp"

namespace uniphy::kernels {

/// A body: the particles [begin, end) and the law that they follow.
template <class T>
struct BodyRange {
  std::ptrdiff_t begin = 0, end = 0;
  std::shared_ptr<const LawKernel<T>> law;
};

/// What the law saw and answered in one step: F_trial, F_proj, C (1/s), tau (Pa), each [P,9].
template <class T>
struct LawSample {
  std::vector<T> F_trial, F_proj, C, tau;
};

/// By which positions the particles are sorted, and since when. The order of summation, hence the
/// bits, depends on it: a run that goes on from the last state of another gets its bits with this.
template <class T>
struct SortState {
  std::ptrdiff_t steps = 0;  ///< since the particles were sorted; 0: they will be
  std::vector<T> x;          ///< [P,3] m, where they were then; empty with steps = 0
};

template <class T>
struct RunOptions {
  /// Called with the state before the first step and then after every `every` steps (0: never);
  /// returning false ends the run. x is always filled; v, C and F where asked for, else empty.
  std::function<bool(std::ptrdiff_t step, const ParticleState<T>&)> on_frame;
  std::ptrdiff_t every = 0;
  bool frame_v = false, frame_C = false, frame_F = false;

  /// Called for the steps that sample_step picks (step s leads from state s to state s + 1).
  std::function<bool(std::ptrdiff_t step)> sample_step;
  std::function<void(std::ptrdiff_t step, const LawSample<T>&)> on_sample;

  /// Number of the first step, for callbacks and messages.
  std::ptrdiff_t first_step = 0;
  /// Where not null, the run goes on from *sort and leaves there where it ended.
  SortState<T>* sort = nullptr;
};

/// What the backward pass needs of a forward one: checkpoints, about sqrt(steps) of them.
/// Belongs to the caller; several may exist at once.
template <class T>
struct RolloutTape {
  std::ptrdiff_t steps = 0, every = 0, segment = 0;
  std::vector<ParticleState<T>> checkpoints;  ///< before step 0, segment, 2 segment, …
};

/// dL/d(initial state), shapes as in ParticleState, and dL/d(law parameters) of each body; where
/// asked for, dL/d(weights of its networks) too (LawKernel::weight_gradient), else empty.
template <class T>
struct RolloutGradient {
  ParticleState<T> state;
  std::vector<std::vector<T>> parameters, weights;
};

/// The material point method with explicit time steps (MLS-MPM with APIC transfers and quadratic
/// B-splines): each step computes
///   F ← G((I + Δt C) F),  τ ← τ(F, C)                      deformation_update.hpp, the body's law
///   grid ← P2G(x, v, C, τ)                                   p2g.hpp
///   v_n ← walls(p_n/m_n + Δt g)                              grid_update.hpp
///   v, C ← G2P(v_n),  x ← x + Δt v                           g2p.hpp
/// and its adjoint by hand-written sibling kernels. Runs on all OpenMP threads; results have the
/// same bits whatever their number. Immutable: several calls may run at the same time.
///
/// A particle whose stencil leaves the grid, or whose position is no longer finite, ends the run
/// with an Error that names the particle, its position, the step and the likely cause.
template <class T>
class Rollout {
 public:
  /// mass (kg) and volume (rest volume, m³) [P]; bodies contiguous, in order, covering all.
  /// Throws Error where they do not, or where a number is not positive (of a Tracer: not 0) or the
  /// settings are bad.
  Rollout(const GridSettings& grid, std::vector<BodyRange<T>> bodies, std::vector<T> mass,
          std::vector<T> volume);

  std::ptrdiff_t particles() const { return static_cast<std::ptrdiff_t>(mass_.size()); }
  const GridSettings& grid() const { return grid_; }
  const std::vector<BodyRange<T>>& bodies() const { return bodies_; }
  const std::vector<T>& mass() const { return mass_; }
  const std::vector<T>& volume() const { return volume_; }

  /// Whether some body's law has memory. Then states have it: an empty one is filled with zeros.
  bool has_memory() const;

  /// Advances `state` by `steps` steps, or until a callback says stop; returns the steps done.
  std::ptrdiff_t run(ParticleState<T>& state, std::ptrdiff_t steps,
                     const RunOptions<T>& options = {}) const;

  /// frames in a differentiable roll-out of `steps`: states 0, every, 2 every, … ≤ steps.
  static std::ptrdiff_t frame_count(std::ptrdiff_t steps, std::ptrdiff_t every) {
    return steps / every + 1;
  }
  /// The differentiable roll-out. Writes frames_x [frame_count, P, 3] and, unless null, frames_v of
  /// the same shape; what adjoint() needs goes to *tape, unless null.
  void record(const ParticleState<T>& initial, std::ptrdiff_t steps, std::ptrdiff_t every,
              T* frames_x, T* frames_v, RolloutTape<T>* tape) const;
  /// The adjoint: grad_x and grad_v are dL/d(frames), either may be null. of_weights says of each
  /// body whether the gradient of its networks is wanted; empty: of none.
  RolloutGradient<T> adjoint(const RolloutTape<T>& tape, const T* grad_x, const T* grad_v,
                             const std::vector<bool>& of_weights = {}) const;

 private:
  GridSettings grid_;
  std::vector<BodyRange<T>> bodies_;
  std::vector<T> mass_, volume_;
};

}  // namespace uniphy::kernels
