#pragma once

#include <cstddef>
#include <vector>

namespace uniphy::kernels {

/// Particles at one instant, row-major and in the user's order: x [P,3] m, v [P,3] m/s, affine
/// velocity C [P,9] 1/s, deformation gradient F [P,9], memory of the law [P]
/// (LawKernel::has_memory; empty: 0 of every particle). In files, absent fields are empty.
template <class T>
struct ParticleState {
  std::vector<T> x, v, C, F, memory = {};

  std::ptrdiff_t size() const { return static_cast<std::ptrdiff_t>(x.size() / 3); }
  /// The state before the first step: F = I, C = 0, no memory.
  static ParticleState undeformed(std::vector<T> x, std::vector<T> v);
};

}  // namespace uniphy::kernels
