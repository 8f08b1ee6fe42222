#include "ops/learned/learned_networks.hpp"

#include <torch/torch.h>

#include <vector>

namespace uniphy::ops {
namespace {

FlatLayers tensors(const kernels::MlpWeights& mlp, torch::Dtype dtype) {
  std::vector<LinearLayer> layers;
  for (const kernels::MlpWeights::Layer& layer : mlp.layers) {
    layers.push_back(
        {torch::tensor(layer.weight, torch::kFloat64).view({layer.out, layer.in}).to(dtype),
         torch::tensor(layer.bias, torch::kFloat64).to(dtype)});
  }
  return flatten(layers);
}

std::vector<double> numbers(const torch::Tensor& t) {
  const torch::Tensor flat = t.detach().to(torch::kFloat64).contiguous();
  return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
}

kernels::MlpWeights weights(const FlatLayers& flat) {
  kernels::MlpWeights mlp;
  for (const LinearLayer& layer : layers_of(flat)) {
    mlp.layers.push_back({int(layer.weight.size(1)), int(layer.weight.size(0)),
                          numbers(layer.weight), numbers(layer.bias)});
  }
  return mlp;
}

}  // namespace

LearnedNetworks to_networks(const kernels::LearnedLawWeights& weights, torch::Dtype dtype) {
  weights.check();
  return {weights.form, weights.activation, weights.latent_size, tensors(weights.projection, dtype),
          tensors(weights.stress, dtype)};
}

kernels::LearnedLawWeights to_weights(const LearnedNetworks& networks) {
  kernels::LearnedLawWeights w;
  w.form = networks.form;
  w.latent_size = int(networks.latent_size);
  w.activation = networks.activation;
  w.projection = weights(networks.projection);
  w.stress = weights(networks.stress);
  return w;
}

}  // namespace uniphy::ops
