#include "ops/reference/return_mapping.hpp"

#include <torch/torch.h>

#include <cmath>

#include "ops/kernels/spectral/limits.hpp"
#include "ops/reference/svd3.hpp"

namespace uniphy::ops::reference {

using kernels::LawId;
using torch::Tensor;

namespace {

Tensor volumetric(const Tensor& F) {
  const Tensor J = torch::linalg_det(F).clamp_min(1e-6);
  return J.pow(1.0 / 3).view({-1, 1, 1}) * torch::eye(3, F.options());
}

}  // namespace

Tensor return_mapping(LawId law, const Tensor& F, const Material& m, double dt) {
  if (law == LawId::elastic || law == LawId::fixed_corotated) return F;
  if (law == LawId::newtonian || law == LawId::water) return volumetric(F);
  const auto number = [&F](const Parameter& p) { return p.tensor().to(F.scalar_type()); };
  const Tensor mu = number(m.mu), lambda = number(m.lambda), tau_y = number(m.tau_y);
  const Svd3 svd = svd3(F);
  const Tensor stretch = svd.sigma.clamp_min(kernels::kMinimumStretch);
  const Tensor strain = stretch.log();
  const Tensor trace = strain.sum(-1, true);
  const Tensor deviator = strain - trace / 3;
  // A norm of zero has no derivative; such particles do not yield, or go to the tip.
  const Tensor squared = deviator.square().sum(-1, true);
  const Tensor norm = torch::where(squared > 0, squared, torch::ones_like(squared)).sqrt() *
                      (squared > 0).to(F.scalar_type());
  const Tensor direction = deviator / torch::where(squared > 0, norm, torch::ones_like(norm));

  Tensor projected, yields;  // log Σ', and where it applies
  if (law == LawId::sand) {
    const Tensor sine = number(m.theta).sin();
    const Tensor alpha = std::sqrt(2.0 / 3) * 2 * sine / (3 - sine);
    const Tensor excess = norm + alpha * (3 * lambda + 2 * mu) / (2 * mu) * trace;
    projected = torch::where(trace > 0, torch::zeros_like(strain), strain - excess * direction);
    yields = (trace > 0).logical_or(excess > 0);
  } else {
    const Tensor excess = norm - tau_y / (2 * mu);
    yields = excess > 0;
    if (law == LawId::plasticine) {
      projected = strain - excess * direction;
    } else {
      const Tensor mu_hat = mu / 3 * stretch.square().sum(-1, true);
      const Tensor s = 2 * mu * norm;
      const Tensor s_hat = s - 2 * mu * excess / (1 + number(m.eta) / (2 * mu_hat * dt));
      projected = s_hat / (2 * mu) * direction + trace / 3;
    }
  }
  const Tensor mapped = torch::matmul(svd.U * projected.exp().unsqueeze(-2), svd.Vh);
  return torch::where(yields.unsqueeze(-1), mapped, F);
}

}  // namespace uniphy::ops::reference
