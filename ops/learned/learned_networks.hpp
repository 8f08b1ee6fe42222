#pragma once

#include <torch/types.h>

#include <cstdint>
#include <memory>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/mlp/mlp.hpp"

namespace uniphy::ops {

/// What the ops keep of a LearnedNetworks between their calls (kernel_weights).
class KernelWeightsCache;
std::shared_ptr<KernelWeightsCache> make_kernel_weights_cache();

/// The two networks of a learned law as tensors, which the ops of the law and the roll-out are
/// differentiable by. Copies share the numbers.
struct LearnedNetworks {
  kernels::LawForm form = kernels::LawForm::isotropic;
  kernels::Activation activation = kernels::Activation::silu;
  std::int64_t latent_size = 0;
  /// The first layers take the features of kernels::network_shape(form), then z. Numbers float32
  /// or float64, both alike, of any dtype of the particles.
  FlatLayers projection, stress;

  /// Shared by copies.
  std::shared_ptr<KernelWeightsCache> cache = make_kernel_weights_cache();

  bool defined() const { return projection.numbers.defined(); }
};

/// Copies without gradient. to_networks throws Error where the weights do not fit.
LearnedNetworks to_networks(const kernels::LearnedLawWeights& weights, torch::Dtype dtype);
kernels::LearnedLawWeights to_weights(const LearnedNetworks& networks);

/// Throws Error naming the op, the tensor, what was expected and what was found.
void check_networks(const char* op, const LearnedNetworks& networks);

/// Which networks of a law are to run (kernels::without_stress, without_projection).
enum class LawPart { both, projection, stress };

/// The numbers for the kernels, after check_networks. They are kept with the networks, so that
/// calls with the same numbers neither convert nor pack them again; whether they are the same is
/// seen from the numbers themselves, since not every way to write into a tensor counts its version.
std::shared_ptr<const kernels::LearnedLawWeights> kernel_weights(const LearnedNetworks& networks,
                                                                 LawPart part = LawPart::both);

}  // namespace uniphy::ops
