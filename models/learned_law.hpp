#pragma once

#include <torch/nn.h>

#include <cstdint>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/learned/learned_law.hpp"

namespace uniphy::models {

/// The size and kind of a learned law.
struct LearnedLawOptions {
  kernels::LawForm form = kernels::LawForm::isotropic;
  kernels::Activation activation = kernels::Activation::silu;
  std::int64_t latent_size = 8;
  std::int64_t hidden_layers = 3;  ///< of each network
  std::int64_t width = 32;         ///< of each hidden layer
  // Isotropic form: whether the caps and the moduli answer to the state, or to z alone.
  bool state_caps = false;
  bool state_moduli = false;
};

class LearnedLaw;

/// The learned law as a torch module: what Algorithm 1 trains, Algorithm 2 differentiates and an
/// export writes. Its parameters are two flat tensors, "projection" and "stress", each with the
/// weights and biases of one network (ops::FlatLayers): the cost of an optimizer is by the tensor.
/// The formulas: ops/kernels/learned/isotropic_law.hpp and published_law.hpp.
///
///   LearnedLaw law(options, generator);
///   Tensor F_proj = law->project(F, z), tau = law->stress(F_proj, C, z);
class LearnedLawImpl : public torch::nn::Module {
 public:
  /// Draws float32 weights from the generator: hidden layers that keep the variance of their
  /// input, and a small last layer. Throws Error naming the option that is out of its range.
  LearnedLawImpl(const LearnedLawOptions& options, torch::Generator& generator);
  /// Throws Error where the weights do not fit (LearnedLawWeights::check).
  explicit LearnedLawImpl(const kernels::LearnedLawWeights& weights,
                          torch::Dtype dtype = torch::kFloat32);

  /// The numbers without torch, for the kernels and for model files.
  kernels::LearnedLawWeights weights() const { return ops::to_weights(networks_); }
  /// The parameters as the ops take them, differentiable; they share their numbers.
  const ops::LearnedNetworks& networks() const { return networks_; }
  /// A law of the same numbers, shared, that asks for no gradient: a fit of z alone need not pay
  /// for those of the weights.
  LearnedLaw frozen() const;

  /// F, F_proj, C [P, 3, 3] (1, 1, 1/s), z [Z], dt in s → [P, 3, 3] (1, Pa), through the ops of
  /// ops/learned/learned_law.hpp. evaluate is both in one pass.
  torch::Tensor project(const torch::Tensor& F, const torch::Tensor& z,
                        double dt = kernels::kFlowStep) const;
  torch::Tensor stress(const torch::Tensor& F_proj, const torch::Tensor& C,
                       const torch::Tensor& z) const;
  ops::LawOutput evaluate(const torch::Tensor& F_trial, const torch::Tensor& C,
                          const torch::Tensor& z, double dt = kernels::kFlowStep) const;

  kernels::LawForm form() const { return networks_.form; }
  kernels::Activation activation() const { return networks_.activation; }
  std::int64_t latent_size() const { return networks_.latent_size; }
  /// Whether the caps and the moduli answer to the state: not where the first layer began with a
  /// weight of 0 for each of its features.
  bool state_caps() const { return state_caps_; }
  bool state_moduli() const { return state_moduli_; }
  std::int64_t parameter_count() const;

 private:
  LearnedLawImpl(ops::LearnedNetworks networks, bool requires_grad);

  ops::LearnedNetworks networks_;
  bool state_caps_, state_moduli_;
};
TORCH_MODULE(LearnedLaw);

}  // namespace uniphy::models
