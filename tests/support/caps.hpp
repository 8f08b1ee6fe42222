#pragma once

#include <stdexcept>

#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::testing {

/// The isotropic law with a projection whose caps are about c0 and c2 (units of the strain scale)
/// at every state, m = 0.3, η̃ = 0.4 and p̃ = 0.2: smooth at rest where c0 ≠ 0, c2 > 0, which random
/// weights seldom are.
inline kernels::LearnedLawWeights with_caps(kernels::LearnedLawWeights weights, double c0,
                                            double c2) {
  if (weights.form != kernels::LawForm::isotropic)
    throw std::invalid_argument("with_caps: expected the isotropic form");
  kernels::MlpWeights::Layer& last = weights.projection.layers.back();
  for (double& w : last.weight) w *= 0.1;
  last.bias = {c0, c2, 0.3, 0.4, 0.2};
  return weights;
}

}  // namespace uniphy::testing
