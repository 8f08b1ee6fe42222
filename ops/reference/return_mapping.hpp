#pragma once

#include <torch/types.h>

#include "ops/laws/material.hpp"

namespace uniphy::ops::reference {

/// The same as ops::return_mapping in plain tensor operations on top of torch::linalg_svd; formulas
/// in the order of the papers, not of the kernels. Autograd gives a gradient only where the
/// singular values are apart.
torch::Tensor return_mapping(kernels::LawId law, const torch::Tensor& F, const Material& material,
                             double dt);

}  // namespace uniphy::ops::reference
