#include "ops/reference/return_mapping.hpp"

#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
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

/// The strain by its trace and its deviator, as the mappings take it.
struct Strain {
  explicit Strain(const Tensor& sigma, const Tensor& memory = {})
      : stretch(sigma.clamp_min(kernels::kMinimumStretch)) {
    const Tensor logarithm = stretch.log();
    const Tensor own = logarithm.sum(-1, true);
    deviator = logarithm - own / 3;
    trace = memory.defined() ? own + memory.unsqueeze(-1) : own;
    // A norm of zero has no derivative; such particles do not yield, or go to the tip.
    const Tensor squared = deviator.square().sum(-1, true);
    norm = torch::where(squared > 0, squared, torch::ones_like(squared)).sqrt() *
           (squared > 0).to(sigma.scalar_type());
    direction = deviator / torch::where(squared > 0, norm, torch::ones_like(norm));
  }
  Tensor whole() const { return deviator + trace / 3; }
  Tensor stretch, trace, deviator, norm, direction;
};

/// log Σ' of Drucker–Prager, and where the strain is outside of the cone.
std::pair<Tensor, Tensor> drucker_prager(const Strain& e, const Tensor& mu, const Tensor& lambda,
                                         const Tensor& sine, const Tensor& cohesion) {
  const Tensor alpha = std::sqrt(2.0 / 3) * 2 * sine / (3 - sine);
  const Tensor t = e.trace - cohesion;
  const Tensor excess = e.norm + alpha * (3 * lambda + 2 * mu) / (2 * mu) * t;
  const Tensor strain = e.whole();
  const Tensor inside = torch::where(excess > 0, strain - excess * e.direction, strain);
  return {torch::where(t > 0, cohesion / 3 + torch::zeros_like(strain), inside),
          (t > 0).logical_or(excess > 0)};
}

/// ‖s‖ of Herschel–Bulkley after a step, from ‖s_trial‖ > τ_Y: the root by bisection, and one step
/// of Newton's method for its derivative.
Tensor herschel_bulkley_norm(const Tensor& trial, const Tensor& mu, const Tensor& tau_y,
                             const Tensor& eta, const Tensor& n, double dt) {
  const auto residual = [&](const Tensor& s) {
    return s + 2 * mu * dt * ((s - tau_y) / eta).pow(1 / n) - trial;
  };
  Tensor root;
  {
    const torch::NoGradGuard no_grad;
    Tensor low = tau_y + torch::zeros_like(trial), high = trial.clone();
    for (int i = 0; i < 100; ++i) {
      const Tensor middle = (low + high) / 2, above = residual(middle) > 0;
      high = torch::where(above, middle, high);
      low = torch::where(above, low, middle);
    }
    root = high;
  }
  const Tensor slope = 1 + 2 * mu * dt / n / eta * ((root - tau_y) / eta).pow(1 / n - 1);
  return root - residual(root) / slope.detach();
}

}  // namespace

Tensor return_mapping(LawId law, const Tensor& F, const Material& m, double dt) {
  if (kernels::law_has_memory(law))
    throw Error(std::string("law ") + kernels::law_name(law) + " has memory");
  if (law == LawId::elastic || law == LawId::fixed_corotated || law == LawId::mooney_rivlin)
    return F;
  if (law == LawId::newtonian || law == LawId::water || law == LawId::carreau) return volumetric(F);
  const auto number = [&F](const Parameter& p) { return p.tensor().to(F.scalar_type()); };
  const Tensor mu = number(m.mu), lambda = number(m.lambda), tau_y = number(m.tau_y);
  const Svd3 svd = svd3(F);
  const Strain e(svd.sigma);

  Tensor projected, yields;  // log Σ', and where it applies
  if (law == LawId::sand || law == LawId::cohesive_sand) {
    const Tensor cohesion = law == LawId::sand ? torch::zeros({}, F.options()) : number(m.cohesion);
    std::tie(projected, yields) = drucker_prager(e, mu, lambda, number(m.theta).sin(), cohesion);
  } else {
    const Tensor excess = e.norm - tau_y / (2 * mu);
    yields = excess > 0;
    if (law == LawId::plasticine) {
      projected = e.whole() - excess * e.direction;
    } else if (law == LawId::herschel_bulkley) {
      // Where it does not yield the answer is not used; a trial beyond the yield stress keeps it
      // finite there.
      const Tensor trial = torch::where(yields, 2 * mu * e.norm, 2 * tau_y + mu);
      const Tensor s = herschel_bulkley_norm(trial, mu, tau_y, number(m.eta), number(m.n), dt);
      projected = s / (2 * mu) * e.direction + e.trace / 3;
    } else {
      const Tensor mu_hat = mu / 3 * e.stretch.square().sum(-1, true);
      const Tensor s = 2 * mu * e.norm;
      const Tensor s_hat = s - 2 * mu * excess / (1 + number(m.eta) / (2 * mu_hat * dt));
      projected = s_hat / (2 * mu) * e.direction + e.trace / 3;
    }
  }
  const Tensor mapped = torch::matmul(svd.U * projected.exp().unsqueeze(-2), svd.Vh);
  return torch::where(yields.unsqueeze(-1), mapped, F);
}

MemoryMapping return_mapping_with_memory(LawId law, const Tensor& F, const Tensor& memory,
                                         const Material& m) {
  if (!kernels::law_has_memory(law))
    throw Error(std::string("law ") + kernels::law_name(law) + " has no memory");
  const auto number = [&F](const Parameter& p) { return p.tensor().to(F.scalar_type()); };
  const Svd3 svd = svd3(F);
  const Tensor projected = drucker_prager(Strain(svd.sigma, memory), number(m.mu), number(m.lambda),
                                          number(m.theta).sin(), torch::zeros({}, F.options()))
                               .first;
  const Tensor trial = svd.sigma.clamp_min(kernels::kMinimumStretch).log().sum(-1);
  return {torch::matmul(svd.U * projected.exp().unsqueeze(-2), svd.Vh),
          memory + trial - projected.sum(-1)};
}

}  // namespace uniphy::ops::reference
