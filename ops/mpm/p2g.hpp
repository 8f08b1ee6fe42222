#pragma once

#include <torch/types.h>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy::ops {

/// Particle-to-grid transfer (ops/kernels/mpm/p2g.hpp): momentum (kg m/s) and mass (kg) of each
/// node, [n, n, n, 4].
///   x [P, 3] m, v [P, 3] m/s, C [P, 3, 3] 1/s, tau [P, 3, 3] Pa (Kirchhoff), mass [P] kg,
///   volume [P] m³ at rest
/// All float32 or all float64, CPU. Differentiable, once, by all of them. The same bits on any
/// number of threads. Throws Error naming the argument, what was expected and what was found, or
/// the particle whose stencil leaves the grid.
torch::Tensor p2g(const torch::Tensor& x, const torch::Tensor& v, const torch::Tensor& C,
                  const torch::Tensor& tau, const torch::Tensor& mass, const torch::Tensor& volume,
                  const kernels::GridSettings& settings);

}  // namespace uniphy::ops
