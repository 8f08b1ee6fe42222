#pragma once

#include <torch/types.h>

#include "ops/kernels/laws/law.hpp"
#include "ops/laws/material.hpp"
#include "ops/spectral/svd3.hpp"

// The plastic laws in plain tensor operations through U and V, the way that is known to fail where
// two singular values meet: the derivatives of U and V hold 1/(σj² − σi²).

namespace uniphy::stability {

enum class SvdDerivative {
  raw,     ///< torch::linalg_svd and its own derivative
  clamped  ///< the same formula with σj² − σi² ≤ −1e-6 for i < j, as in NCLaw and Warp
};
inline constexpr double kSvdClamp = 1e-6;

/// F [P, 3, 3] → factors in the convention of ops::svd3 (rotations, the sign of det F on the last
/// value), differentiable in the given way.
ops::Svd3 svd_with(SvdDerivative derivative, const torch::Tensor& F);

struct PlasticTensors {
  torch::Tensor F_proj;  ///< [P, 3, 3]
  torch::Tensor tau;     ///< [P, 3, 3] Pa
};
/// Return mapping and Kirchhoff stress of plasticine, sand or non_newtonian (formulas: von_mises,
/// drucker_prager, viscoplastic and hencky.hpp in ops/kernels/laws), dt in s.
PlasticTensors plastic_tensors(const kernels::LawDescription& law, const ops::Svd3& svd,
                               const torch::Tensor& F, double dt);

}  // namespace uniphy::stability
