#pragma once

#include <string>

#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::models {

/// The methods of an exported law, `project(F, z)` and `stress(F_proj, C, z)`, in the language of
/// TorchScript; the same formulas as ops/kernels/learned/isotropic_law.hpp and published_law.hpp.
/// The buffers that they read are projection_weight_k, projection_bias_k, stress_weight_k,
/// stress_bias_k.
std::string script_source(const kernels::LearnedLawWeights& weights, bool single_precision);

}  // namespace uniphy::models
