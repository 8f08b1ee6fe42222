#pragma once

#include <torch/types.h>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy::ops::reference {

/// ops::p2g in plain tensor operations, slow; differentiable by autograd.
torch::Tensor p2g(const torch::Tensor& x, const torch::Tensor& v, const torch::Tensor& C,
                  const torch::Tensor& tau, const torch::Tensor& mass, const torch::Tensor& volume,
                  const kernels::GridSettings& settings);

}  // namespace uniphy::ops::reference
