#pragma once

#include <vector>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/kernels/learned/published_scales.hpp"

namespace uniphy::testing {

/// The published form with F_proj = F − part (F − I) and no stress.
inline kernels::LearnedLawWeights published_return(double part, int latent_size) {
  const kernels::NetworkShape shape = kernels::network_shape(kernels::LawForm::published);
  const auto layer = [latent_size](int features) {
    const int in = features + latent_size;
    return kernels::MlpWeights::Layer{in, 9, std::vector<double>(std::size_t(in) * 9, 0.0),
                                      std::vector<double>(9, 0.0)};
  };
  kernels::LearnedLawWeights weights;
  weights.form = kernels::LawForm::published;
  weights.latent_size = latent_size;
  weights.projection.layers = {layer(shape.projection_in)};
  weights.stress.layers = {layer(shape.stress_in)};
  kernels::MlpWeights::Layer& projection = weights.projection.layers[0];
  for (int k = 0; k < 9; ++k)  // F − I comes first
    projection.weight[std::size_t(k) * projection.in + k] = -part / kernels::kDeltaOverStrain;
  return weights;
}

}  // namespace uniphy::testing
