#pragma once

#include "ops/mpm/g2p.hpp"

namespace uniphy::ops::reference {

/// ops::g2p in plain tensor operations, slow; differentiable by autograd.
G2p g2p(const torch::Tensor& x, const torch::Tensor& velocity,
        const kernels::GridSettings& settings);

}  // namespace uniphy::ops::reference
