#include "uniphy/training/networks.hpp"

#include <cmath>

namespace uniphy {
namespace {

using kernels::MlpWeights;
using ops::FlatLayers;
using ops::LinearLayer;

FlatLayers leaf(const std::vector<LinearLayer>& layers) {
  FlatLayers flat = ops::flatten(layers);
  flat.numbers.requires_grad_();
  return flat;
}

FlatLayers random_mlp(std::int64_t in, std::int64_t out, const NetworkOptions& o,
                      torch::Generator& generator) {
  std::vector<LinearLayer> layers;
  for (std::int64_t k = 0; k <= o.hidden_layers; ++k) {
    const std::int64_t from = k == 0 ? in + o.latent_size : o.width;
    const bool last = k == o.hidden_layers;
    const std::int64_t to = last ? out : o.width;
    // A small last layer starts both laws near "nothing happens"; 1.6/sqrt(n) keeps the variance
    // through silu and gelu.
    const double deviation = (last ? 0.3 : k == 0 ? 1.0 : 1.6) / std::sqrt(double(from));
    torch::Tensor weight = torch::randn({to, from}, generator, torch::kFloat32) * deviation;
    torch::Tensor bias =
        last ? torch::zeros({to}) : torch::randn({to}, generator, torch::kFloat32) * 0.1;
    layers.push_back({weight, bias});
  }
  return leaf(layers);
}

MlpWeights numbers(const FlatLayers& flat) {
  MlpWeights mlp;
  for (const LinearLayer& layer : ops::layers_of(flat)) {
    const torch::Tensor weight = layer.weight.detach().to(torch::kFloat64).contiguous();
    const torch::Tensor bias = layer.bias.detach().to(torch::kFloat64).contiguous();
    const double *w = weight.data_ptr<double>(), *b = bias.data_ptr<double>();
    mlp.layers.push_back(
        {int(weight.size(1)), int(weight.size(0)), {w, w + weight.numel()}, {b, b + bias.numel()}});
  }
  return mlp;
}

FlatLayers tensors(const MlpWeights& mlp) {
  std::vector<LinearLayer> layers;
  for (const MlpWeights::Layer& layer : mlp.layers) {
    const auto options = torch::TensorOptions().dtype(torch::kFloat64);
    const torch::Tensor weight =
        torch::tensor(layer.weight, options).view({layer.out, layer.in}).to(torch::kFloat32);
    const torch::Tensor bias = torch::tensor(layer.bias, options).to(torch::kFloat32);
    layers.push_back({weight, bias});
  }
  return leaf(layers);
}

}  // namespace

Networks Networks::random(const NetworkOptions& options, torch::Generator& generator) {
  const kernels::NetworkShape shape = kernels::network_shape(options.form);
  Networks n;
  n.options = options;
  n.projection = random_mlp(shape.projection_in, shape.projection_out, options, generator);
  n.stress = random_mlp(shape.stress_in, shape.stress_out, options, generator);
  if (options.form == kernels::LawForm::isotropic) {
    torch::NoGradGuard no_grad;
    const auto caps = ops::layers_of(n.projection), moduli = ops::layers_of(n.stress);
    if (!options.state_caps) caps.front().weight.narrow(1, 0, shape.projection_in).zero_();
    if (!options.state_moduli) moduli.front().weight.narrow(1, 0, shape.stress_in).zero_();
    // Between the materials' exponents, and off γ = 0, where the derivative to γ vanishes.
    moduli.back().bias.narrow(0, 5, 2).fill_(1);
  }
  return n;
}

Networks Networks::from_weights(const kernels::LearnedLawWeights& weights) {
  Networks n;
  n.options.form = weights.form;
  n.options.activation = weights.activation;
  n.options.latent_size = weights.latent_size;
  n.options.hidden_layers = std::int64_t(weights.stress.layers.size()) - 1;
  n.options.width = weights.stress.layers.front().out;
  const kernels::NetworkShape shape = kernels::network_shape(weights.form);
  n.options.state_caps = !kernels::ignores_state(weights.projection, shape.projection_in);
  n.options.state_moduli = !kernels::ignores_state(weights.stress, shape.stress_in);
  n.projection = tensors(weights.projection);
  n.stress = tensors(weights.stress);
  return n;
}

kernels::LearnedLawWeights Networks::weights() const {
  kernels::LearnedLawWeights w;
  w.form = options.form;
  w.latent_size = int(options.latent_size);
  w.activation = options.activation;
  w.projection = numbers(projection);
  w.stress = numbers(stress);
  return w;
}

std::vector<torch::Tensor> Networks::parameters() const {
  return {projection.numbers, stress.numbers};
}

std::int64_t Networks::parameter_count() const {
  std::int64_t count = 0;
  for (const torch::Tensor& t : parameters()) count += t.numel();
  return count;
}

Networks Networks::frozen() const {
  Networks n = *this;
  n.projection.numbers = projection.numbers.detach();
  n.stress.numbers = stress.numbers.detach();
  return n;
}

}  // namespace uniphy
