#include "ops/reference/p2g.hpp"

#include "ops/base/torch.hpp"
#include "ops/reference/stencil.hpp"

namespace uniphy::ops::reference {

using torch::Tensor;

Tensor p2g(const Tensor& x, const Tensor& v, const Tensor& C, const Tensor& tau, const Tensor& mass,
           const Tensor& volume, const kernels::GridSettings& settings) {
  const std::int64_t n = settings.n;
  const Stencil s = stencil(x, settings);
  const Tensor A = -settings.dt * 4.0 * n * n * volume.view({-1, 1, 1}) * tau +
                   mass.view({-1, 1, 1}) * C;  // [P, 3, 3]
  const Tensor affine = torch::matmul(A.unsqueeze(1), s.offset.unsqueeze(3)).squeeze(3);
  const Tensor momentum = (mass.unsqueeze(1) * v).unsqueeze(1) + affine;  // [P, 27, 3]
  const Tensor m = mass.view({-1, 1, 1}).expand({-1, 27, 1});
  const Tensor each = s.weight.unsqueeze(2) * torch::cat({momentum, m}, 2);  // [P, 27, 4]
  return torch::zeros({n * n * n, 4}, x.options())
      .index_add(0, s.node.flatten(), each.reshape({-1, 4}))
      .view({n, n, n, 4});
}

}  // namespace uniphy::ops::reference
