#pragma once

#include <cstdint>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::ops {

/// One linear layer: weight [out, in], bias [out].
struct LinearLayer {
  torch::Tensor weight;
  torch::Tensor bias;
};

/// A whole network in one tensor, for optimizers, whose cost is by the tensor: the weight,
/// row-major, and the bias of each layer one after the other, [P]. widths: what each layer takes,
/// then what the last one gives.
struct FlatLayers {
  torch::Tensor numbers;
  std::vector<std::int64_t> widths;
};
/// Views of the numbers; gradients go through.
std::vector<LinearLayer> layers_of(const FlatLayers& flat);
/// A copy; gradients go through. Throws Error where there is no layer.
FlatLayers flatten(const std::vector<LinearLayer>& layers);

/// A multilayer perceptron as one op: x [S, in] → [S, out], differentiable by x and by every weight
/// and bias. The activation follows every layer but the last. The fused kernel walks tiles of
/// particles whose activations stay in the cache and recomputes them in the backward pass, so that
/// the graph keeps x alone. Sums over samples have one order on any number of threads. float32 or
/// float64, all tensors alike; throws Error quoting the expected and the found shape or type.
torch::Tensor mlp(const torch::Tensor& x, const std::vector<LinearLayer>& layers,
                  kernels::Activation activation);

/// The same for samples that share codes: features [N, m, f] with z [N, Z] beside every sample of a
/// code, the first layer's inputs being the features, then z → [N, m, out]. Differentiable by z
/// too.
torch::Tensor mlp(const torch::Tensor& features, const torch::Tensor& z,
                  const std::vector<LinearLayer>& layers, kernels::Activation activation);

torch::Tensor mlp(const torch::Tensor& features, const torch::Tensor& z, const FlatLayers& layers,
                  kernels::Activation activation);

}  // namespace uniphy::ops
