#pragma once

#include <torch/types.h>

#include "ops/laws/return_mapping.hpp"

namespace uniphy::ops::reference {

/// The same as ops::return_mapping in plain tensor operations on top of torch::linalg_svd; formulas
/// in the order of the papers, not of the kernels. Autograd gives a gradient only where the
/// singular values are apart.
torch::Tensor return_mapping(kernels::LawId law, const torch::Tensor& F, const Material& material,
                             double dt);

/// The same as ops::return_mapping_with_memory, of the one law that has one.
MemoryMapping return_mapping_with_memory(kernels::LawId law, const torch::Tensor& F,
                                         const torch::Tensor& memory, const Material& material);

}  // namespace uniphy::ops::reference
