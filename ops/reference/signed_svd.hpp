#pragma once

#include <torch/types.h>

namespace uniphy::ops::reference {

/// F = U diag(sigma) Vᵀ with U, V rotations, |sigma| in decreasing order, the sign of det F on the
/// last one (spec of the signed convention: ops/kernels/spectral/svd3.hpp).
struct SignedSvd {
  torch::Tensor U;      ///< [P, 3, 3]
  torch::Tensor sigma;  ///< [P, 3]
  torch::Tensor V;      ///< [P, 3, 3]
};

/// F [P, 3, 3], float32 or float64. One-sided Jacobi in plain tensor operations, rotation by
/// rotation that of kernels::svd3, so that U and V agree in the signs that the convention leaves
/// open, and not only up to them (LAPACK's do not).
///
/// Differentiable: the exact derivative of U and V holds 1/(σj² − σi²); here it is d/(d² + ε²σ⁴),
/// d = σj² − σi², ε = 1e-6 (float64) or 1e-3 (float32) and σ the largest singular value: never NaN,
/// exact away from equal values. Isotropic functions of F have exact gradients that do not need it:
/// isotropic_tensors.hpp.
SignedSvd signed_svd(const torch::Tensor& F);

}  // namespace uniphy::ops::reference
