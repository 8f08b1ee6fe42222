#pragma once

#include <cmath>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/mlp/mlp.hpp"
#include "tests/support/tensors.hpp"

namespace uniphy::testing {

/// Random layers of the given widths, all of them leaves that gradients reach.
inline std::vector<ops::LinearLayer> network_layers(std::vector<std::int64_t> widths,
                                                    torch::Dtype type) {
  torch::manual_seed(4);
  std::vector<ops::LinearLayer> result;
  for (std::size_t k = 0; k + 1 < widths.size(); ++k)
    result.push_back(
        {(torch::randn({widths[k + 1], widths[k]}, type) / std::sqrt(double(widths[k])))
             .requires_grad_(),
         torch::randn({widths[k + 1]}, type).requires_grad_()});
  return result;
}

/// x, then the weight and the bias of each layer.
inline std::vector<torch::Tensor> network_leaves(const torch::Tensor& x,
                                                 const std::vector<ops::LinearLayer>& l) {
  std::vector<torch::Tensor> all{x};
  for (const ops::LinearLayer& layer : l) {
    all.push_back(layer.weight);
    all.push_back(layer.bias);
  }
  return all;
}

/// Relative errors of the network op's gradients against central differences in float64.
struct NetworkErrors {
  double x = 0, weights = 0, biases = 0;
};

inline NetworkErrors network_errors(kernels::Activation activation) {
  auto layers = network_layers({9, 20, 33, 5}, torch::kFloat64);
  const torch::Tensor x = torch::randn({70, 9}, torch::kFloat64).requires_grad_();
  const torch::Tensor seed = torch::randn({70, 5}, torch::kFloat64);
  const auto got = torch::autograd::grad({(seed * ops::mlp(x, layers, activation)).sum()},
                                         network_leaves(x, layers));
  const torch::NoGradGuard guard;
  const auto difference = [&](torch::Tensor& slot) {
    const torch::Tensor keep = slot;
    const torch::Tensor g = numerical_gradient(
        [&](const torch::Tensor& at) {
          slot = at;
          return (seed * ops::mlp(x, layers, activation)).sum();
        },
        keep, 1e-3);
    slot = keep;
    return g;
  };
  NetworkErrors worst;
  const auto error = [&](const torch::Tensor& g, const torch::Tensor& expected, double& slot) {
    slot = std::max(slot, ((g - expected).norm() / expected.norm()).item<double>());
  };
  const torch::Tensor of_x = numerical_gradient(
      [&](const torch::Tensor& at) { return (seed * ops::mlp(at, layers, activation)).sum(); }, x,
      1e-3);
  error(got[0], of_x, worst.x);
  for (std::size_t k = 0; k < layers.size(); ++k) {
    error(got[1 + 2 * k], difference(layers[k].weight), worst.weights);
    error(got[2 + 2 * k], difference(layers[k].bias), worst.biases);
  }
  return worst;
}

}  // namespace uniphy::testing
