#pragma once

#include <torch/types.h>

#include "ops/laws/material.hpp"

namespace uniphy::ops::reference {

/// The same as ops::kirchhoff_stress in plain tensor operations on top of torch::linalg_svd.
/// Autograd gives a gradient only where the singular values are apart.
torch::Tensor kirchhoff_stress(kernels::LawId law, const torch::Tensor& F, const torch::Tensor& C,
                               const Material& material);

}  // namespace uniphy::ops::reference
