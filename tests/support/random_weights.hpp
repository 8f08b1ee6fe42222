#pragma once

#include <cmath>
#include <random>

#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::testing {

/// An untrained learned law with seeded weights, scaled so that signals keep their size.
inline kernels::LearnedLawWeights random_weights(kernels::LawForm form, int latent_size, int width,
                                                 int hidden, kernels::Activation activation,
                                                 unsigned seed, double gain = 1.0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto network = [&](int in, int out) {
    kernels::MlpWeights mlp;
    for (int k = 0; k <= hidden; ++k) {
      kernels::MlpWeights::Layer layer;
      layer.in = k == 0 ? in + latent_size : width;
      layer.out = k == hidden ? out : width;
      for (int i = 0; i < layer.in * layer.out; ++i)
        layer.weight.push_back(gain * normal(random) / std::sqrt(double(layer.in)));
      for (int i = 0; i < layer.out; ++i) layer.bias.push_back(0.3 * normal(random));
      mlp.layers.push_back(layer);
    }
    return mlp;
  };
  const kernels::NetworkShape shape = kernels::network_shape(form);
  kernels::LearnedLawWeights weights;
  weights.form = form;
  weights.latent_size = latent_size;
  weights.activation = activation;
  weights.projection = network(shape.projection_in, shape.projection_out);
  weights.stress = network(shape.stress_in, shape.stress_out);
  return weights;
}

}  // namespace uniphy::testing
