#pragma once

#include "ops/mlp/mlp.hpp"

namespace uniphy::ops::reference {

/// ops::mlp in plain tensor operations.
torch::Tensor mlp(const torch::Tensor& x, const std::vector<LinearLayer>& layers,
                  kernels::Activation activation);
torch::Tensor mlp(const torch::Tensor& features, const torch::Tensor& z, const FlatLayers& layers,
                  kernels::Activation activation);

}  // namespace uniphy::ops::reference
