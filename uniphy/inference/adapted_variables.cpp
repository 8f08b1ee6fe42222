#include "uniphy/inference/adapted_variables.hpp"

#include "ops/base/torch.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// Rows of the biases of the last layer, at the end of a network whose numbers begin at `begin`.
Tensor last_biases(const ops::FlatLayers& layers, std::int64_t begin) {
  const std::int64_t end = begin + layers.numbers.numel();
  return torch::arange(end - layers.widths.back(), end);
}

/// The biases of the last layers among the numbers of both networks.
Tensor own_numbers(const ops::LearnedNetworks& networks) {
  const std::int64_t first = networks.projection.numbers.numel();
  return torch::cat({last_biases(networks.projection, 0), last_biases(networks.stress, first)});
}

}  // namespace

const char* rung_name(Rung rung) { return kRungNames[static_cast<int>(rung)]; }

bool can_be_adapted(const FitVariables& variables) {
  const Tensor u = torch::tensor(variables.start(0), torch::kFloat64);
  return variables.body(u, 0).networks.defined();
}

AdaptedVariables::AdaptedVariables(const FitVariables& latent, Rung rung)
    : latent_(latent),
      networks_(latent.body(torch::tensor(latent.start(0), torch::kFloat64), 0).networks) {
  const std::int64_t first = networks_.projection.numbers.numel();
  const std::int64_t count = first + networks_.stress.numbers.numel();
  const Tensor biases = own_numbers(networks_);
  const Tensor none = torch::empty({0}, torch::kInt64);
  Tensor others = torch::ones({count}, torch::kBool);
  others.index_fill_(0, biases, false);
  free_ = rung == Rung::latent ? none : rung == Rung::numbers ? biases : torch::arange(count);
  pulled_ = rung == Rung::weights ? others.nonzero().flatten() : none;
}

int AdaptedVariables::size() const { return latent_.size() + static_cast<int>(free_.numel()); }

/// What is added to all numbers of both networks; gradients go through.
Tensor AdaptedVariables::added(const Tensor& u) const {
  const std::int64_t count =
      networks_.projection.numbers.numel() + networks_.stress.numbers.numel();
  return torch::zeros({count}, torch::kFloat64)
      .index_add(0, free_, u.slice(0, latent_.size(), u.numel()));
}

ops::RolloutBody AdaptedVariables::body(const Tensor& u, std::ptrdiff_t particles) const {
  ops::RolloutBody body = latent_.body(code(u), particles);
  if (free_.numel() == 0) return body;
  const Tensor change = added(u);
  const std::int64_t first = networks_.projection.numbers.numel();
  body.networks.projection.numbers = networks_.projection.numbers + change.slice(0, 0, first);
  body.networks.stress.numbers = networks_.stress.numbers + change.slice(0, first, change.numel());
  body.networks.cache = ops::make_kernel_weights_cache();
  body.law.weights = ops::kernel_weights(body.networks);
  return body;
}

Tensor AdaptedVariables::departure(const Tensor& u) const {
  if (pulled_.numel() == 0) return {};
  return added(u).index_select(0, pulled_).square().sum();
}

std::vector<double> AdaptedVariables::start(int i) const {
  std::vector<double> u = latent_.start(i);
  u.resize(static_cast<std::size_t>(size()), 0.0);
  return u;
}

Tensor AdaptedVariables::widened(const AdaptedVariables& from, const Tensor& u) const {
  const Tensor change = from.added(u.detach());
  return torch::cat({from.code(u.detach()), change.index_select(0, free_)});
}

std::vector<std::int64_t> AdaptedVariables::leading() const {
  std::vector<std::int64_t> columns;
  for (std::int64_t k = 0; k < latent_.size(); ++k) columns.push_back(k);
  const Tensor biases = own_numbers(networks_);
  for (std::int64_t k = 0; k < free_.numel(); ++k) {
    if (biases.eq(free_[k]).any().item<bool>()) columns.push_back(latent_.size() + k);
  }
  return columns;
}

Tensor AdaptedVariables::outputs(const Tensor& u) const {
  const torch::NoGradGuard no_grad;
  const ops::RolloutBody at = body(u, 0);
  std::vector<Tensor> answers;
  for (const ops::FlatLayers* layers : {&at.networks.projection, &at.networks.stress}) {
    Tensor in = torch::zeros({1, layers->widths.front()}, torch::kFloat64);
    const std::int64_t features = in.size(1) - at.parameters.numel();
    in[0].slice(0, features, in.size(1)).copy_(at.parameters);
    answers.push_back(ops::mlp(in, ops::layers_of(*layers), at.networks.activation)[0]);
  }
  return torch::cat(answers);
}

}  // namespace uniphy
