#include "models/learned_law.hpp"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::models {
namespace {

using ops::FlatLayers;
using ops::LinearLayer;
using torch::Tensor;

void check_sizes(const LearnedLawOptions& options) {
  const auto expect = [](bool holds, const std::string& what, std::int64_t found) {
    if (!holds) throw Error("learned law: " + what + ", found " + std::to_string(found));
  };
  expect(options.latent_size >= 0, "latent_size: expected 0 or more numbers", options.latent_size);
  expect(options.hidden_layers >= 0, "hidden_layers: expected 0 or more", options.hidden_layers);
  expect(options.width >= 1, "width: expected 1 or more units", options.width);
}

FlatLayers random_network(std::int64_t in, std::int64_t out, const LearnedLawOptions& o,
                          torch::Generator& generator) {
  std::vector<LinearLayer> layers;
  for (std::int64_t k = 0; k <= o.hidden_layers; ++k) {
    const std::int64_t from = k == 0 ? in + o.latent_size : o.width;
    const bool last = k == o.hidden_layers;
    const std::int64_t to = last ? out : o.width;
    // A small last layer starts both laws near "nothing happens"; 1.6/sqrt(n) keeps the variance
    // through silu and gelu.
    const double deviation = (last ? 0.3 : k == 0 ? 1.0 : 1.6) / std::sqrt(double(from));
    const Tensor weight = torch::randn({to, from}, generator, torch::kFloat32) * deviation;
    const Tensor bias =
        last ? torch::zeros({to}) : torch::randn({to}, generator, torch::kFloat32) * 0.1;
    layers.push_back({weight, bias});
  }
  return ops::flatten(layers);
}

ops::LearnedNetworks random_networks(const LearnedLawOptions& options,
                                     torch::Generator& generator) {
  check_sizes(options);
  const kernels::NetworkShape shape = kernels::network_shape(options.form);
  ops::LearnedNetworks n;
  n.form = options.form;
  n.activation = options.activation;
  n.latent_size = options.latent_size;
  n.projection = random_network(shape.projection_in, shape.projection_out, options, generator);
  n.stress = random_network(shape.stress_in, shape.stress_out, options, generator);
  if (options.form == kernels::LawForm::isotropic) {
    const auto caps = ops::layers_of(n.projection), moduli = ops::layers_of(n.stress);
    if (!options.state_caps) caps.front().weight.narrow(1, 0, shape.projection_in).zero_();
    if (!options.state_moduli) moduli.front().weight.narrow(1, 0, shape.stress_in).zero_();
    // Between the materials' exponents, and off γ = 0, where the derivative to γ vanishes. The two
    // strain measures start apart.
    for (const auto k : {kernels::kShearExponent, kernels::kVolumeGamma})
      moduli.back().bias.select(0, k).fill_(1);
    moduli.back().bias.select(0, kernels::kSecondExponent).fill_(-1);
  }
  return n;
}

bool answers_to_state(const FlatLayers& layers, int features) {
  const Tensor weight = ops::layers_of(layers).front().weight;
  return weight.narrow(1, 0, features).ne(0).any().item<bool>();
}

}  // namespace

LearnedLawImpl::LearnedLawImpl(ops::LearnedNetworks networks, bool requires_grad)
    : networks_(std::move(networks)) {
  for (const auto& [name, layers] :
       {std::pair{"projection", &networks_.projection}, {"stress", &networks_.stress}})
    layers->numbers = register_parameter(name, layers->numbers, requires_grad);
  const torch::NoGradGuard no_grad;
  const kernels::NetworkShape shape = kernels::network_shape(form());
  state_caps_ = answers_to_state(networks_.projection, shape.projection_in);
  state_moduli_ = answers_to_state(networks_.stress, shape.stress_in);
}

LearnedLawImpl::LearnedLawImpl(const LearnedLawOptions& options, torch::Generator& generator)
    : LearnedLawImpl(random_networks(options, generator), true) {}

LearnedLawImpl::LearnedLawImpl(const kernels::LearnedLawWeights& weights, torch::Dtype dtype)
    : LearnedLawImpl(ops::to_networks(weights, dtype), true) {}

LearnedLaw LearnedLawImpl::frozen() const {
  ops::LearnedNetworks n = networks_;
  n.projection.numbers = n.projection.numbers.detach();
  n.stress.numbers = n.stress.numbers.detach();
  return LearnedLaw(std::shared_ptr<LearnedLawImpl>(new LearnedLawImpl(std::move(n), false)));
}

Tensor LearnedLawImpl::project(const Tensor& F, const Tensor& z, double dt) const {
  return ops::learned_project(networks_, F, z, dt);
}

Tensor LearnedLawImpl::stress(const Tensor& F_proj, const Tensor& C, const Tensor& z) const {
  return ops::learned_stress(networks_, F_proj, C, z);
}

ops::LawOutput LearnedLawImpl::evaluate(const Tensor& F_trial, const Tensor& C, const Tensor& z,
                                        double dt) const {
  return ops::learned_law(networks_, F_trial, C, z, dt);
}

std::int64_t LearnedLawImpl::parameter_count() const {
  return networks_.projection.numbers.numel() + networks_.stress.numbers.numel();
}

}  // namespace uniphy::models
