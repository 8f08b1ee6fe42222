#pragma once

#include <torch/types.h>

#include <cstdint>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/mlp/mlp.hpp"

namespace uniphy::ops {

/// The two networks of a learned law as tensors, which the ops of the law and the roll-out are
/// differentiable by. Copies share the numbers.
struct LearnedNetworks {
  kernels::LawForm form = kernels::LawForm::isotropic;
  kernels::Activation activation = kernels::Activation::silu;
  std::int64_t latent_size = 0;
  /// The first layers take the features of kernels::network_shape(form), then z. Numbers float32
  /// or float64, both alike.
  FlatLayers projection, stress;

  bool defined() const { return projection.numbers.defined(); }
};

/// Copies without gradient. to_networks throws Error where the weights do not fit.
LearnedNetworks to_networks(const kernels::LearnedLawWeights& weights, torch::Dtype dtype);
kernels::LearnedLawWeights to_weights(const LearnedNetworks& networks);

}  // namespace uniphy::ops
