#include "ops/reference/mlp.hpp"

namespace uniphy::ops::reference {
namespace {

torch::Tensor activate(const torch::Tensor& x, kernels::Activation activation) {
  switch (activation) {
    case kernels::Activation::gelu:
      return torch::gelu(x);
    case kernels::Activation::silu:
      return torch::silu(x);
    case kernels::Activation::squareplus:
      break;
  }
  return 0.5 * (x + torch::sqrt(x * x + 4.0)) - 1.0;
}

/// The layers after the first, whose answer is x.
torch::Tensor rest(torch::Tensor x, const std::vector<LinearLayer>& layers,
                   kernels::Activation activation) {
  for (std::size_t k = 1; k < layers.size(); ++k)
    x = torch::linear(activate(x, activation), layers[k].weight, layers[k].bias);
  return x;
}

}  // namespace

torch::Tensor mlp(const torch::Tensor& x, const std::vector<LinearLayer>& layers,
                  kernels::Activation activation) {
  return rest(torch::linear(x, layers[0].weight, layers[0].bias), layers, activation);
}

torch::Tensor mlp(const torch::Tensor& features, const torch::Tensor& z, const FlatLayers& flat,
                  kernels::Activation activation) {
  const std::vector<LinearLayer> layers = layers_of(flat);
  const std::int64_t n = features.size(2);
  const torch::Tensor &weight = layers[0].weight, &bias = layers[0].bias;
  // What z adds is the same for all samples of a code: no need to copy z beside each of them.
  const torch::Tensor of_code = torch::linear(z, weight.slice(1, n), bias).unsqueeze(1);
  return rest(torch::matmul(features, weight.slice(1, 0, n).t()) + of_code, layers, activation);
}

}  // namespace uniphy::ops::reference
