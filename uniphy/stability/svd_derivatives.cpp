#include "uniphy/stability/svd_derivatives.hpp"

#include <cmath>
#include <tuple>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/spectral/limits.hpp"

namespace uniphy::stability {
namespace {

using kernels::LawId;
using torch::Tensor;

/// linalg_svd gives orthogonal factors and values ≥ 0; the last columns take the signs.
ops::Svd3 signed_factors(const Tensor& F) {
  const auto [U, sigma, Vh] = torch::linalg_svd(F);
  const Tensor of_U = torch::linalg_det(U).detach().sign(),
               of_V = torch::linalg_det(Vh).detach().sign();
  const Tensor one = torch::ones_like(of_U);
  const Tensor u = torch::stack({one, one, of_U}, -1), v = torch::stack({one, one, of_V}, -1);
  return {U * u.unsqueeze(-2), sigma * (u * v), Vh * v.unsqueeze(-1)};
}

class ClampedSvd : public torch::autograd::Function<ClampedSvd> {
 public:
  static torch::autograd::variable_list forward(torch::autograd::AutogradContext* ctx,
                                                const Tensor& F) {
    const ops::Svd3 s = signed_factors(F);
    ctx->save_for_backward({s.U, s.sigma, s.Vh});
    return {s.U, s.sigma, s.Vh};
  }

  /// With P = Uᵀ dL/dU, Q = Vᵀ dL/dV and K_ij = 1/(σj² − σi²) off the diagonal:
  ///   dL/dF = U [ (K∘(P − Pᵀ)) Σ + Σ (K∘(Q − Qᵀ)) + diag(dL/dσ) ] Vᵀ
  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* ctx,
                                                 torch::autograd::variable_list grad) {
    const auto saved = ctx->get_saved_variables();
    const Tensor U = saved[0], sigma = saved[1], V = saved[2].mT();
    const Tensor square = sigma.square();
    const Tensor gap = square.unsqueeze(-2) - square.unsqueeze(-1);  // [P, i, j]: σj² − σi²
    // Values are sorted: above the diagonal the gap is ≤ 0.
    const Tensor above = gap.clamp_max(-kSvdClamp).reciprocal().triu(1);
    const Tensor K = above - above.mT();
    Tensor A = torch::zeros_like(U);
    if (grad[0].defined()) {
      const Tensor P = U.mT().matmul(grad[0]);
      A = A + K * (P - P.mT()) * sigma.unsqueeze(-2);
    }
    if (grad[2].defined()) {
      const Tensor Q = V.mT().matmul(grad[2].mT());
      A = A + sigma.unsqueeze(-1) * (K * (Q - Q.mT()));
    }
    if (grad[1].defined()) A = A + torch::diag_embed(grad[1]);
    return {U.matmul(A).matmul(V.mT())};
  }
};

}  // namespace

ops::Svd3 svd_with(SvdDerivative derivative, const Tensor& F) {
  if (derivative == SvdDerivative::raw) return signed_factors(F);
  const auto r = ClampedSvd::apply(F);
  return {r[0], r[1], r[2]};
}

PlasticTensors plastic_tensors(const kernels::LawDescription& law, const ops::Svd3& svd,
                               const Tensor& F, double dt) {
  const double mu = law.mu, lambda = law.lambda;
  const Tensor stretch = svd.sigma.clamp_min(kernels::kMinimumStretch), strain = stretch.log();
  const Tensor trace = strain.sum(-1, true), deviator = strain - trace / 3;
  // ‖ε̂‖ without the infinite slope of the root at 0: what is shown here is the SVD's own failure.
  const Tensor squared = deviator.square().sum(-1, true), there = squared > 0;
  const Tensor norm = torch::where(there, squared, torch::ones_like(squared)).sqrt() * there;
  const Tensor direction = deviator / torch::where(there, norm, torch::ones_like(norm));

  Tensor projected, yields;
  if (law.id == LawId::sand) {
    const double sine = std::sin(law.theta), alpha = std::sqrt(2.0 / 3) * 2 * sine / (3 - sine);
    const Tensor excess = norm + alpha * (3 * lambda + 2 * mu) / (2 * mu) * trace;
    projected = torch::where(trace > 0, torch::zeros_like(strain),
                             strain - excess.clamp_min(0) * direction);
    yields = (trace > 0).logical_or(excess > 0);
  } else if (law.id == LawId::plasticine || law.id == LawId::non_newtonian) {
    const Tensor excess = norm - law.tau_y / (2 * mu);
    yields = excess > 0;
    if (law.id == LawId::plasticine) {
      projected = strain - excess * direction;
    } else {
      const Tensor mu_hat = mu / 3 * stretch.square().sum(-1, true);
      projected = strain - excess / (1 + law.eta / (2 * mu_hat * dt)) * direction;
    }
  } else {
    throw Error("plastic_tensors: expected plasticine, sand or non_newtonian");
  }
  const Tensor mapped = torch::matmul(svd.U * projected.exp().unsqueeze(-2), svd.Vh);
  PlasticTensors out;
  out.F_proj = torch::where(yields.unsqueeze(-1), mapped, F);
  // The stress of the projected F, whose factors are the same.
  const Tensor left =
      torch::where(yields, projected, strain).clamp_min(std::log(kernels::kMinimumStretch));
  const Tensor principal = 2 * mu * left + lambda * left.sum(-1, true);
  out.tau = torch::matmul(svd.U * principal.unsqueeze(-2), svd.U.mT());
  return out;
}

}  // namespace uniphy::stability
