#pragma once

#include <map>
#include <string>

#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::models {

/// The numbers of the formulas by the names that models/script uses for them, in the precision of
/// the exported law.
std::map<std::string, double> script_constants(bool single_precision);

/// The methods of an exported law, `project(F, z)`, `stress(F_proj, C, z)` and `code_of(material)`,
/// in the language of TorchScript: those of models/script with the constants written out, and the
/// networks. The buffers that they read are projection_weight_k, projection_bias_k,
/// stress_weight_k, stress_bias_k and codes; the attribute, materials.
std::string script_source(const kernels::LearnedLawWeights& weights, bool single_precision);

}  // namespace uniphy::models
