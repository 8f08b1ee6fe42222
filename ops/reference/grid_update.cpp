#include "ops/reference/grid_update.hpp"

#include <vector>

#include "ops/base/torch.hpp"

namespace uniphy::ops::reference {

using torch::Tensor;

Tensor grid_update(const Tensor& grid, const kernels::GridSettings& settings) {
  const std::int64_t n = settings.n;
  const Tensor mass = grid.narrow(3, 3, 1);
  const Tensor occupied = mass > 0;
  const Tensor safe = torch::where(occupied, mass, torch::ones_like(mass));
  const Tensor momentum = grid.narrow(3, 0, 3);
  const Tensor gravity =
      torch::tensor({settings.gravity[0], settings.gravity[1], settings.gravity[2]},
                    grid.options().requires_grad(false));
  const Tensor v =
      torch::where(occupied, momentum / safe, torch::zeros_like(momentum)) + settings.dt * gravity;

  const Tensor index = torch::arange(n, torch::kInt64);
  std::vector<Tensor> clamped;
  for (int a = 0; a < 3; ++a) {
    std::vector<std::int64_t> shape{1, 1, 1};
    shape[a] = n;
    const Tensor low = (index < settings.bound).view(shape);
    const Tensor high = (index > n - settings.bound).view(shape);
    const Tensor component = v.select(3, a);
    clamped.push_back((low & (component < 0)) | (high & (component > 0)));
  }
  Tensor mask = torch::stack(clamped, 3);
  if (settings.wall == kernels::Wall::noslip) mask = mask.any(3, true).expand_as(mask);
  return torch::where(mask, torch::zeros_like(v), v);
}

}  // namespace uniphy::ops::reference
