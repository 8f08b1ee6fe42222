#pragma once

#include <torch/types.h>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy::ops {

/// Momentum to velocity, gravity and walls (ops/kernels/mpm/grid_update.hpp).
///   grid [n, n, n, 4]: momentum (kg m/s) and mass (kg)  →  velocity [n, n, n, 3] m/s
/// float32 or float64, CPU. Differentiable, once; components that a wall makes zero, and nodes
/// without mass, pass no gradient. Throws Error naming what was expected and what was found.
torch::Tensor grid_update(const torch::Tensor& grid, const kernels::GridSettings& settings);

}  // namespace uniphy::ops
