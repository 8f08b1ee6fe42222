#pragma once

#include <torch/types.h>

#include "ops/learned/learned_networks.hpp"

// The learned law as differentiable ops around its fused kernels
// (ops/kernels/learned/learned_law.hpp, where the formulas stand). Gradients go to F, C, z and the
// numbers of the networks; where no number needs one, its price is not paid. Numbers of networks
// that answer to z alone have the gradient of any others: that of the weights of the state features
// is not zero, though they are.
//
// F, F_trial, F_proj, C [P, 3, 3], z [Z]: CPU, all float32 or all float64. C in 1/s, tau in Pa, dt,
// the time step that a viscoplastic projection depends on, in s. The
// results, and the gradients of z and of the networks, have the same bits on any number of threads.
// Throws Error naming the argument, what was expected and what was found.

namespace uniphy::ops {

struct LawOutput {
  torch::Tensor F_proj;  ///< [P, 3, 3]
  torch::Tensor tau;     ///< [P, 3, 3] Pa
};

/// F_proj = G(F_trial), tau = τ(F_proj, C), in one pass.
LawOutput learned_law(const LearnedNetworks& networks, const torch::Tensor& F_trial,
                      const torch::Tensor& C, const torch::Tensor& z,
                      double dt = kernels::kFlowStep);

/// G(F); the stress network does not run.
torch::Tensor learned_project(const LearnedNetworks& networks, const torch::Tensor& F,
                              const torch::Tensor& z, double dt = kernels::kFlowStep);

/// τ(F_proj, C); the projection network does not run.
torch::Tensor learned_stress(const LearnedNetworks& networks, const torch::Tensor& F_proj,
                             const torch::Tensor& C, const torch::Tensor& z);

}  // namespace uniphy::ops
