#include "ops/reference/stencil.hpp"

#include <vector>

#include "ops/base/torch.hpp"

namespace uniphy::ops::reference {

using torch::Tensor;

Stencil stencil(const Tensor& x, const kernels::GridSettings& settings) {
  const double inv_dx = settings.n;
  const Tensor base = (x.detach() * inv_dx - 0.5).floor();
  const Tensor f = x * inv_dx - base;  // [P, 3]
  const Tensor w = torch::stack(
      {0.5 * (1.5 - f).square(), 0.75 - (f - 1).square(), 0.5 * (f - 0.5).square()}, 1);
  const Tensor corner = base.to(torch::kInt64);
  std::vector<Tensor> node, weight, offset;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) {
        const Tensor ix = corner.select(1, 0) + i, iy = corner.select(1, 1) + j,
                     iz = corner.select(1, 2) + k;
        node.push_back((ix * settings.n + iy) * settings.n + iz);
        weight.push_back(w.select(1, i).select(1, 0) * w.select(1, j).select(1, 1) *
                         w.select(1, k).select(1, 2));
        offset.push_back(torch::stack({ix, iy, iz}, 1).to(x.scalar_type()) * settings.dx() - x);
      }
    }
  }
  return {torch::stack(node, 1), torch::stack(weight, 1), torch::stack(offset, 1)};
}

}  // namespace uniphy::ops::reference
