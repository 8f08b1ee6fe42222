#pragma once

#include <torch/types.h>

#include <vector>

#include "uniphy/inference/adapted_variables.hpp"

namespace uniphy {

/// Points to fit the law's own numbers from, beside u, a point of `numbers`.
///
/// The stress of the isotropic form is a sum of two strain measures (isotropic_law.hpp). A law with
/// one leaves both alike, a₁ m(ε; n) + a₂ m(ε; n), and nothing tells a fit which way to part them:
/// all directions in which the second one serves are missing from its Jacobian. Here they are
/// apart: 2a and −a in place of a = a₁ + a₂, with exponents one apart on either side of n = (a₁ n₁
/// + a₂ n₂)/a, so that the stress is that of u to second order in the strain.
///
/// From u alone, least squares leave fixed-corotated elasticity, 4μ m(ε; 2) − 2μ m(ε; 1), at 2e-4
/// of the size over 0.4 of half a second of the benchmark cube, from any elastic code; from one of
/// these points they come to 2e-5 in three iterations.
///
/// None of a law without elastic shear, and none of the published form.
std::vector<torch::Tensor> split_terms(const AdaptedVariables& numbers, const torch::Tensor& u);

}  // namespace uniphy
