#pragma once

#include <torch/types.h>

#include <memory>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/learned/learned_networks.hpp"

// The learned law as differentiable ops around its fused kernels
// (ops/kernels/learned/learned_law.hpp, where the formulas stand). Gradients go to F, C and z; the
// weights are constants (Algorithm 2 fits z alone; uniphy/training trains them,
// models/learned_law.hpp has them as a torch module).
//
// F, F_trial, F_proj, C [P, 3, 3], z [Z]: CPU, all float32 or all float64. C in 1/s, tau in Pa. The
// results, and the gradient of z, have the same bits on any number of threads. Throws Error naming
// the argument, what was expected and what was found.

namespace uniphy::ops {

using SharedWeights = std::shared_ptr<const kernels::LearnedLawWeights>;

struct LawOutput {
  torch::Tensor F_proj;  ///< [P, 3, 3]
  torch::Tensor tau;     ///< [P, 3, 3] Pa
};

/// F_proj = G(F_trial), tau = τ(F_proj, C), in one pass.
LawOutput learned_law(const SharedWeights& weights, const torch::Tensor& F_trial,
                      const torch::Tensor& C, const torch::Tensor& z);

/// G(F); the stress network does not run.
torch::Tensor learned_project(const SharedWeights& weights, const torch::Tensor& F,
                              const torch::Tensor& z);

/// τ(F_proj, C); the projection network does not run.
torch::Tensor learned_stress(const SharedWeights& weights, const torch::Tensor& F_proj,
                             const torch::Tensor& C, const torch::Tensor& z);

LawOutput learned_law(const LearnedNetworks& networks, const torch::Tensor& F_trial,
                      const torch::Tensor& C, const torch::Tensor& z);
torch::Tensor learned_project(const LearnedNetworks& networks, const torch::Tensor& F,
                              const torch::Tensor& z);
torch::Tensor learned_stress(const LearnedNetworks& networks, const torch::Tensor& F_proj,
                             const torch::Tensor& C, const torch::Tensor& z);

}  // namespace uniphy::ops
