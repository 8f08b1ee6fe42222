#include "ops/reference/svd3.hpp"

#include <tuple>

#include "ops/base/torch.hpp"

namespace uniphy::ops::reference {

using torch::Tensor;

Svd3 svd3(const Tensor& F) {
  const auto [U, sigma, Vh] = torch::linalg_svd(F, /*full_matrices=*/false);
  // The sign of a rotation's last column is free: turn it where the factor is a reflection.
  const auto sign = [](const Tensor& m) {
    const Tensor det = torch::linalg_det(m.detach());
    return torch::where(det < 0, -torch::ones_like(det), torch::ones_like(det));
  };
  const Tensor of_U = sign(U), of_V = sign(Vh), one = torch::ones_like(of_U);
  const Tensor column = torch::stack({one, one, of_U}, -1);
  const Tensor row = torch::stack({one, one, of_V}, -1);
  return {U * column.unsqueeze(-2), sigma * (column * row), Vh * row.unsqueeze(-1)};
}

}  // namespace uniphy::ops::reference
