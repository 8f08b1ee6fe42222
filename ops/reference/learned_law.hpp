#pragma once

#include <torch/types.h>

#include "ops/learned/learned_networks.hpp"

// The learned law in plain tensor operations: the reference of ops/learned/learned_law.hpp. The
// formulas are those of ops/kernels/learned/isotropic_law.hpp and published_law.hpp.
//
// F, F_proj, C [P, 3, 3] (dimensionless, dimensionless, 1/s); z [Z] for all particles or [P, Z];
// tau [P, 3, 3] Pa. All tensors share one dtype, float32 or float64.

namespace uniphy::ops::reference {

/// s = 1e4 exp(3 z₀) Pa and e = 0.05 exp(2 z₁), each [] or [P]; constants where z is shorter.
torch::Tensor stress_scale(const torch::Tensor& z);
torch::Tensor strain_scale(const torch::Tensor& z);

/// G(F) at a time step dt, s.
torch::Tensor learned_project(const LearnedNetworks& law, const torch::Tensor& F,
                              const torch::Tensor& z, double dt = kernels::kFlowStep);
/// τ(F_proj, C).
torch::Tensor learned_stress(const LearnedNetworks& law, const torch::Tensor& F_proj,
                             const torch::Tensor& C, const torch::Tensor& z);

// The isotropic form in steps: everything that does not depend on z, the Hencky
// strain H = U log(max(Σ, 0.05)) Uᵀ [P, 3, 3] (isotropic_tensors.hpp), can be computed once.

/// What the projection network says of every particle, each [P].
struct IsotropicCaps {
  torch::Tensor c1;  ///< cap of ‖dev H‖ in units of e
  torch::Tensor c2;  ///< cap of tr H in units of e, min(c₂(rest), 0) taken off
  // v, f and p of what stays above the cap of ‖dev H‖ (kept_excess).
  torch::Tensor viscosity, factor, exponent;
};
IsotropicCaps isotropic_caps(const LearnedNetworks& law, const torch::Tensor& H,
                             const torch::Tensor& z, double dt = kernels::kFlowStep);
/// τ, given H of the projected F.
torch::Tensor isotropic_stress(const LearnedNetworks& law, const torch::Tensor& H,
                               const torch::Tensor& C, const torch::Tensor& z);

}  // namespace uniphy::ops::reference
