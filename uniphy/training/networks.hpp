#pragma once

#include <torch/torch.h>

#include <cstdint>
#include <vector>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/mlp/mlp.hpp"

namespace uniphy {

/// The size and kind of a learned law.
struct NetworkOptions {
  kernels::LawForm form = kernels::LawForm::isotropic;
  kernels::Activation activation = kernels::Activation::silu;
  std::int64_t latent_size = 8;
  std::int64_t hidden_layers = 3;
  std::int64_t width = 32;
  // Isotropic form: whether the caps and the moduli answer to the state, or to z alone.
  bool state_caps = false;
  bool state_moduli = false;
};

/// The two networks as leaf tensors (float32), one each, that an optimizer moves.
struct Networks {
  NetworkOptions options;
  ops::FlatLayers projection;
  ops::FlatLayers stress;

  /// Kaiming weights for the hidden layers and a small last layer, from the generator.
  static Networks random(const NetworkOptions& options, torch::Generator& generator);
  static Networks from_weights(const kernels::LearnedLawWeights& weights);
  kernels::LearnedLawWeights weights() const;
  std::vector<torch::Tensor> parameters() const;
  std::int64_t parameter_count() const;
  /// The same weights, shared, without gradients: a fit of z alone need not pay for theirs.
  Networks frozen() const;
};

}  // namespace uniphy
