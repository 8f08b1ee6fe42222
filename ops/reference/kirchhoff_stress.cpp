#include "ops/reference/kirchhoff_stress.hpp"

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/spectral/limits.hpp"
#include "ops/reference/svd3.hpp"

namespace uniphy::ops::reference {

using kernels::LawId;
using torch::Tensor;

Tensor kirchhoff_stress(LawId law, const Tensor& F, const Tensor& C, const Material& m) {
  const auto number = [&F](const Parameter& p) { return p.tensor().to(F.scalar_type()); };
  const Tensor mu = number(m.mu), lambda = number(m.lambda);
  const Tensor eye = torch::eye(3, F.options());
  const auto spherical = [&eye](const Tensor& p) { return p.view({-1, 1, 1}) * eye; };
  const auto trace = [](const Tensor& a) { return a.diagonal(0, -2, -1).sum(-1); };
  const auto deviator = [&](const Tensor& a) { return a - spherical(trace(a) / 3); };
  switch (law) {
    case LawId::elastic: {
      const Tensor J = torch::linalg_det(F).clamp_min(1e-6);
      return mu * torch::matmul(F, F.transpose(-1, -2)) + spherical(lambda * J.log() - mu);
    }
    case LawId::newtonian: {
      const double floor = F.scalar_type() == torch::kFloat64 ? 1e-6 : 1e-4;
      const Tensor J = torch::linalg_det(F).clamp_min(floor);
      const Tensor pressure = spherical((2 * mu / 3 + lambda) * (J - J.pow(-6)));
      return C.defined() ? pressure + 0.5 * mu * (C + C.transpose(-1, -2)) : pressure;
    }
    case LawId::water: {
      const Tensor J = torch::linalg_det(F);
      return spherical(lambda * J * (J - 1));
    }
    case LawId::fixed_corotated: {
      const Svd3 svd = svd3(F);
      const Tensor R = torch::matmul(svd.U, svd.Vh), J = torch::linalg_det(F);
      return 2 * mu * torch::matmul(F - R, F.transpose(-1, -2)) + spherical(lambda * J * (J - 1));
    }
    case LawId::plasticine:
    case LawId::sand:
    case LawId::volume_corrected_sand:
    case LawId::cohesive_sand:
    case LawId::herschel_bulkley:
    case LawId::non_newtonian: {
      const Svd3 svd = svd3(F);
      const Tensor strain = svd.sigma.clamp_min(kernels::kMinimumStretch).log();
      const Tensor principal = 2 * mu * strain + lambda * strain.sum(-1, true);
      return torch::matmul(svd.U * principal.unsqueeze(-2), svd.U.transpose(-1, -2));
    }
    case LawId::mooney_rivlin: {
      const Tensor J = torch::linalg_det(F).clamp_min(1e-6);
      const Tensor B = J.pow(-2.0 / 3).view({-1, 1, 1}) * torch::matmul(F, F.transpose(-1, -2));
      const Tensor c1 = number(m.c1), c2 = number(m.c2), I1 = trace(B).view({-1, 1, 1});
      const Tensor bar = 2 * (c1 + c2 * I1) * B - 2 * c2 * torch::matmul(B, B);
      return deviator(bar) + spherical(lambda * J * (J - 1));
    }
    case LawId::carreau: {
      const Tensor J = torch::linalg_det(F), pressure = spherical(lambda * J * (J - 1));
      if (!C.defined()) return pressure;
      const Tensor D = deviator(0.5 * (C + C.transpose(-1, -2)));
      const Tensor rate = 2 * D.square().sum({-1, -2}, true);
      const Tensor power = (1 + number(m.kappa).square() * rate).pow((number(m.n) - 1) / 2);
      const Tensor eta_inf = number(m.eta_inf);
      return pressure + 2 * (eta_inf + (number(m.eta) - eta_inf) * power) * D;
    }
    case LawId::learned:
      break;
  }
  throw Error("kirchhoff_stress: law: expected an analytic one, found learned");
}

}  // namespace uniphy::ops::reference
