#pragma once

#include <torch/types.h>

#include "ops/spectral/svd3.hpp"

namespace uniphy::ops::reference {

/// torch::linalg_svd brought into the signed convention of ops::svd3: U and Vhᵀ rotations, the sign
/// of det F on the last singular value. Slow and simple; its gradient is LAPACK-style and infinite
/// or NaN where two singular values meet. F [P, 3, 3].
Svd3 svd3(const torch::Tensor& F);

}  // namespace uniphy::ops::reference
