#pragma once

#include <torch/types.h>

#include "ops/kernels/simd/view.hpp"

// Matrices of many particles, [P, 3, 3], as the kernels take them.

namespace uniphy::ops {

/// Throws Error unless t is [P, 3, 3], float32 or float64, on the CPU.
void check_matrices(const char* op, const char* name, const torch::Tensor& t);
/// Throws Error unless t has the shape and the dtype of F.
void check_like(const char* op, const char* name, const torch::Tensor& t, const torch::Tensor& F);

/// Tensors [P, 3, 3] as views; an undefined tensor is an absent view.
template <class T>
kernels::View<const T> matrix_view(const torch::Tensor& t) {
  return {t.defined() ? t.data_ptr<T>() : nullptr, 9, 1};
}
template <class T>
kernels::View<T> mutable_matrix_view(const torch::Tensor& t) {
  return {t.defined() ? t.data_ptr<T>() : nullptr, 9, 1};
}

/// Particles that one thread takes at a time: fixed, so that sums over particles have one order
/// whatever the number of threads.
inline constexpr std::ptrdiff_t kParticleBlock = 1024;

/// body(first, count) over blocks of particles, in parallel.
template <class Body>
void for_each_block(std::ptrdiff_t particles, const Body& body) {
#pragma omp parallel for schedule(static)
  for (std::ptrdiff_t p = 0; p < particles; p += kParticleBlock) {
    body(p, particles - p < kParticleBlock ? particles - p : kParticleBlock);
  }
}

}  // namespace uniphy::ops
