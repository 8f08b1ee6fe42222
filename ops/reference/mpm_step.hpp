#pragma once

#include <torch/types.h>

#include <functional>
#include <utility>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy::ops::reference {

/// x, v [P, 3]; C, F [P, 3, 3]; units as in kernels::ParticleState.
struct MpmState {
  torch::Tensor x, v, C, F;
};

/// (F_trial, C) → (F_proj, tau)
using TensorLaw =
    std::function<std::pair<torch::Tensor, torch::Tensor>(torch::Tensor, torch::Tensor)>;

/// One step of kernels::Rollout in plain tensor operations, slow; differentiable by autograd. A
/// stencil outside the grid is not looked for.
MpmState mpm_step(const MpmState& state, const torch::Tensor& mass, const torch::Tensor& volume,
                  const TensorLaw& law, const kernels::GridSettings& settings);

}  // namespace uniphy::ops::reference
