#pragma once

#include <torch/types.h>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy::ops::reference {

/// ops::grid_update in plain tensor operations, slow; differentiable by autograd.
torch::Tensor grid_update(const torch::Tensor& grid, const kernels::GridSettings& settings);

}  // namespace uniphy::ops::reference
