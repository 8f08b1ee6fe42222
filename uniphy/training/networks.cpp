#include "uniphy/training/networks.hpp"

#include <cmath>

namespace uniphy {
namespace {

using kernels::MlpWeights;
using ops::LinearLayer;

std::vector<LinearLayer> random_mlp(std::int64_t in, std::int64_t out, const NetworkOptions& o,
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
    layers.push_back({weight.requires_grad_(), bias.requires_grad_()});
  }
  return layers;
}

MlpWeights numbers(const std::vector<LinearLayer>& layers) {
  MlpWeights mlp;
  for (const LinearLayer& layer : layers) {
    const torch::Tensor weight = layer.weight.detach().to(torch::kFloat64).contiguous();
    const torch::Tensor bias = layer.bias.detach().to(torch::kFloat64).contiguous();
    const double *w = weight.data_ptr<double>(), *b = bias.data_ptr<double>();
    mlp.layers.push_back(
        {int(weight.size(1)), int(weight.size(0)), {w, w + weight.numel()}, {b, b + bias.numel()}});
  }
  return mlp;
}

std::vector<LinearLayer> tensors(const MlpWeights& mlp) {
  std::vector<LinearLayer> layers;
  for (const MlpWeights::Layer& layer : mlp.layers) {
    const auto options = torch::TensorOptions().dtype(torch::kFloat64);
    const torch::Tensor weight =
        torch::tensor(layer.weight, options).view({layer.out, layer.in}).to(torch::kFloat32);
    const torch::Tensor bias = torch::tensor(layer.bias, options).to(torch::kFloat32);
    layers.push_back({weight.clone().requires_grad_(), bias.clone().requires_grad_()});
  }
  return layers;
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
    if (!options.state_caps) n.projection.front().weight.narrow(1, 0, shape.projection_in).zero_();
    if (!options.state_moduli) n.stress.front().weight.narrow(1, 0, shape.stress_in).zero_();
    // Between the materials' exponents, and off γ = 0, where the derivative to γ vanishes.
    n.stress.back().bias[5].fill_(1);
    n.stress.back().bias[6].fill_(1);
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
  std::vector<torch::Tensor> all;
  for (const auto* network : {&projection, &stress})
    for (const LinearLayer& layer : *network) {
      all.push_back(layer.weight);
      all.push_back(layer.bias);
    }
  return all;
}

std::int64_t Networks::parameter_count() const {
  std::int64_t count = 0;
  for (const torch::Tensor& t : parameters()) count += t.numel();
  return count;
}

Networks Networks::frozen() const {
  Networks n = *this;
  for (auto* network : {&n.projection, &n.stress})
    for (LinearLayer& layer : *network) layer = {layer.weight.detach(), layer.bias.detach()};
  return n;
}

}  // namespace uniphy
