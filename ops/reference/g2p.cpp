#include "ops/reference/g2p.hpp"

#include "ops/base/torch.hpp"
#include "ops/reference/stencil.hpp"

namespace uniphy::ops::reference {

using torch::Tensor;

G2p g2p(const Tensor& x, const Tensor& velocity, const kernels::GridSettings& settings) {
  const double n = settings.n;
  const Stencil s = stencil(x, settings);
  const Tensor nodes =
      velocity.reshape({-1, 3}).index_select(0, s.node.flatten()).view({x.size(0), 27, 3});
  const Tensor weighted = s.weight.unsqueeze(2) * nodes;  // [P, 27, 3]
  const Tensor v = weighted.sum(1);
  const Tensor C = 4 * n * n * torch::matmul(weighted.transpose(1, 2), s.offset);
  return {x + settings.dt * v, v, C};
}

}  // namespace uniphy::ops::reference
