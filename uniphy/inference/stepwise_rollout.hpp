#pragma once

#include "ops/rollout/rollout.hpp"

namespace uniphy {

/// ops::rollout composed of the ops of single steps, to be read beside Algorithm 2 of UniPhy's
/// supplementary material. The same arguments, results and errors; differentiable by the same
/// tensors. Autograd keeps every step, so memory grows with their number, and a step costs several
/// times as much.
ops::RolloutFrames stepwise_rollout(const torch::Tensor& x0, const torch::Tensor& v0,
                                    const torch::Tensor& C0, const torch::Tensor& F0,
                                    const torch::Tensor& mass, const torch::Tensor& volume,
                                    const std::vector<ops::RolloutBody>& bodies,
                                    const ops::RolloutSettings& settings,
                                    const torch::Tensor& memory0 = {});

}  // namespace uniphy
