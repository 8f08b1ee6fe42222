#pragma once

#include <torch/types.h>

namespace uniphy::ops {

/// F = U diag(sigma) Vh with U and Vhᵀ rotations, |sigma| in decreasing order and the sign of det F
/// on the last one.
struct Svd3 {
  torch::Tensor U;      ///< [P, 3, 3]
  torch::Tensor sigma;  ///< [P, 3]
  torch::Tensor Vh;     ///< [P, 3, 3]
};

/// F [P, 3, 3], float32 or float64, on the CPU; every finite F has an answer. One-sided Jacobi,
/// ops/kernels/spectral/svd3.hpp.
///
/// The gradient with respect to sigma is exact. That of U and Vh holds 1/d, d = σj² − σi², which is
/// replaced by d/(d² + ε²σ₁⁴), ε = 1e-6 (float64) or 1e-3 (float32): never NaN, exact to
/// (ε σ₁²/d)², zero where two singular values are equal. Isotropic functions of F should not be
/// built on it but take return_mapping.hpp and kirchhoff_stress.hpp, whose gradients are exact
/// everywhere. Not differentiable twice. Throws Error where shape, dtype or device differ.
Svd3 svd3(const torch::Tensor& F);

}  // namespace uniphy::ops
