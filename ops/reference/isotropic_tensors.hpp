#pragma once

#include <torch/types.h>

#include "ops/reference/signed_svd.hpp"

// Isotropic tensor functions of F whose gradients, by divided differences, are exact and finite at
// equal singular values, where torch's own SVD gradient is infinite.

namespace uniphy::ops::reference {

/// H = U log(max(Σ, 0.05)) Uᵀ, the Hencky strain: F [P, 3, 3] → [P, 3, 3].
/// With B = Uᵀ dF V: (Uᵀ dH U)_ij = (ε_i − ε_j)/(σ_i² − σ_j²) (σ_j B_ij + σ_i B_ji).
torch::Tensor hencky_tensor(const torch::Tensor& F);

/// R = U Vᵀ: F [P, 3, 3] → [P, 3, 3], given the factors of F (taken as constants; the gradient goes
/// to F). (Uᵀ dR V)_ij = (B_ij − B_ji)/(σ_i + σ_j), the sum bounded away from 0 by 1e-5.
torch::Tensor polar_rotation(const torch::Tensor& F, const SignedSvd& factors);

/// exp M of a symmetric M [P, 3, 3]. (torch::matrix_exp is only good to 1e-9 in float64.)
torch::Tensor symmetric_exp(const torch::Tensor& M);

}  // namespace uniphy::ops::reference
