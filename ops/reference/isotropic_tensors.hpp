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

/// Outputs of networks whose sinh is a coefficient, or that are bounded by ±bound.
torch::Tensor sinh_of(const torch::Tensor& output);
torch::Tensor bounded(const torch::Tensor& output, double bound);

/// x exp(δx) sinh(γx)/(γx), number by number (ops/kernels/spectral/strain_measure.hpp).
torch::Tensor strain_measure(const torch::Tensor& x, const torch::Tensor& gamma,
                             const torch::Tensor& delta);

/// What stays of an excess over a cap, number by number: kept_excess of
/// ops/kernels/learned/return_caps.hpp.
torch::Tensor kept_excess(const torch::Tensor& x, const torch::Tensor& v,
                          const torch::Tensor& factor, const torch::Tensor& p);
/// The power that an output stands for, p = exp(P tanh(p̃/P)).
torch::Tensor flow_exponent(const torch::Tensor& output);
/// v/f, bounded from below.
torch::Tensor relative_viscosity(const torch::Tensor& v, const torch::Tensor& factor);

}  // namespace uniphy::ops::reference
