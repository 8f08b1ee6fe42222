#pragma once

#include <torch/types.h>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy::ops {

struct G2p {
  torch::Tensor x;  ///< [P, 3] m, the new positions
  torch::Tensor v;  ///< [P, 3] m/s
  torch::Tensor C;  ///< [P, 3, 3] 1/s
};

/// Grid-to-particle transfer and the new positions (ops/kernels/mpm/g2p.hpp).
///   x [P, 3] m, velocity [n, n, n, 3] m/s; both float32 or both float64, CPU
/// Differentiable, once, by both. The same bits on any number of threads. Throws Error naming the
/// argument, what was expected and what was found, or the particle whose stencil leaves the grid.
G2p g2p(const torch::Tensor& x, const torch::Tensor& velocity,
        const kernels::GridSettings& settings);

}  // namespace uniphy::ops
