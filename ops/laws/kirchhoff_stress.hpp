#pragma once

#include <torch/types.h>

#include "ops/laws/material.hpp"

namespace uniphy::ops {

/// τ(F, C) in Pa, the Kirchhoff stress of an analytic law at the projected F (formulas:
/// neo_hookean.hpp, newtonian.hpp, hencky.hpp, fixed_corotated.hpp, water.hpp in ops/kernels).
/// F, C [P, 3, 3], float32 or float64, on the CPU; C in 1/s, used by newtonian alone, may be
/// undefined, which is zero.
///
/// Differentiable, once, with respect to F, C and every parameter; stresses that are functions of
/// the singular values are differentiated by divided differences, exact at equal singular values.
/// The same bits on any number of threads. Throws Error naming the argument, what was expected and
/// what was found.
torch::Tensor kirchhoff_stress(kernels::LawId law, const torch::Tensor& F, const torch::Tensor& C,
                               const Material& material);

}  // namespace uniphy::ops
