#pragma once

#include <torch/types.h>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy::ops::reference {

/// The stencil of the quadratic B-spline (ops/kernels/mpm/bspline.hpp) in plain tensor operations,
/// for the 27 nodes of each particle. x [P, 3] m. Differentiable by autograd.
struct Stencil {
  torch::Tensor node;    ///< [P, 27] index of the node in the flattened grid
  torch::Tensor weight;  ///< [P, 27]
  torch::Tensor offset;  ///< [P, 27, 3] x_node − x_p, m
};
Stencil stencil(const torch::Tensor& x, const kernels::GridSettings& settings);

}  // namespace uniphy::ops::reference
