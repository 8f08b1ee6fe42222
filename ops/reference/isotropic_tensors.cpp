#include "ops/reference/isotropic_tensors.hpp"

#include <limits>

#include "ops/base/torch.hpp"
#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/kernels/learned/power_law.hpp"
#include "ops/kernels/spectral/limits.hpp"

namespace uniphy::ops::reference {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

Tensor rows(const Tensor& v) { return v.unsqueeze(2); }     // [P, 3, 1]: the value of row i
Tensor columns(const Tensor& v) { return v.unsqueeze(1); }  // [P, 1, 3]: the value of column j

/// 1/(σ_i + σ_j), sign kept, magnitude of the sum at least kLeastSum. [P, 3, 3]
Tensor inverse_sum(const Tensor& sigma) {
  const Tensor sum = rows(sigma) + columns(sigma);
  const Tensor magnitude = sum.abs().clamp_min(kernels::kLeastSum);
  return 1 / torch::where(sum < 0, -magnitude, magnitude);
}

/// (ε_i − ε_j)/(σ_i − σ_j) of ε = log max(σ, floor); on the diagonal dε_i/dσ_i. [P, 3, 3]
Tensor strain_divided_difference(const Tensor& sigma) {
  const Tensor stretch = sigma.clamp_min(kernels::kMinimumStretch);
  const Tensor a = rows(stretch), b = columns(stretch), gap = a - b;
  const Tensor same = gap == 0, one = torch::ones_like(gap);
  const Tensor of_log =
      torch::where(same, 1 / (b * one), torch::log1p(gap / b) / torch::where(same, one, gap));
  // (stretch_i − stretch_j)/(σ_i − σ_j): 1 above the clamp, 0 below it.
  const Tensor raw = rows(sigma) - columns(sigma);
  const Tensor above =
      (rows(sigma) > kernels::kMinimumStretch) & (columns(sigma) > kernels::kMinimumStretch);
  const Tensor ratio =
      torch::where(raw == 0, torch::zeros_like(raw), gap / torch::where(raw == 0, one, raw));
  return of_log * torch::where(above, one, ratio);
}

class HenckyFunction : public torch::autograd::Function<HenckyFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& F) {
    const SignedSvd s = signed_svd(F.detach());
    ctx->save_for_backward({s.U, s.sigma, s.V});
    return (s.U * columns(s.sigma.clamp_min(kernels::kMinimumStretch).log())).matmul(s.U.mT());
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    if (!grad[0].defined()) return {Tensor()};
    const auto saved = ctx->get_saved_variables();
    const Tensor U = saved[0], sigma = saved[1], V = saved[2];
    const Tensor S = U.mT().matmul(grad[0] + grad[0].mT()).matmul(U);  // twice the symmetric part
    const Tensor c = S * strain_divided_difference(sigma);
    const Tensor off = c * inverse_sum(sigma) * columns(sigma);
    const Tensor diagonal = torch::eye(3, U.options()).to(torch::kBool);
    return {U.matmul(torch::where(diagonal, 0.5 * c, off)).matmul(V.mT())};
  }
};

class PolarFunction : public torch::autograd::Function<PolarFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& /*F*/, const Tensor& U,
                        const Tensor& sigma, const Tensor& V) {
    ctx->save_for_backward({U, sigma, V});
    return U.matmul(V.mT());
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    if (!grad[0].defined()) return {Tensor(), Tensor(), Tensor(), Tensor()};
    const auto saved = ctx->get_saved_variables();
    const Tensor U = saved[0], sigma = saved[1], V = saved[2];
    const Tensor P = U.mT().matmul(grad[0]).matmul(V);
    const Tensor A = (P - P.mT()) * inverse_sum(sigma);
    return {U.matmul(A).matmul(V.mT()), Tensor(), Tensor(), Tensor()};
  }
};

class SymmetricExpFunction : public torch::autograd::Function<SymmetricExpFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& M) {
    const auto [value, Q] = torch::linalg_eigh(M);
    ctx->save_for_backward({value, Q});
    return (Q * columns(value.exp())).matmul(Q.mT());
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    if (!grad[0].defined()) return {Tensor()};
    const auto saved = ctx->get_saved_variables();
    const Tensor value = saved[0], Q = saved[1];
    const Tensor gap = rows(value) - columns(value), one = torch::ones_like(gap);
    const Tensor safe = torch::where(gap == 0, one, gap);
    const Tensor divided = columns(value.exp()) * torch::where(gap == 0, one, gap.expm1() / safe);
    return {Q.matmul(Q.mT().matmul(grad[0]).matmul(Q) * divided).matmul(Q.mT())};
  }
};

}  // namespace

Tensor symmetric_exp(const Tensor& M) { return SymmetricExpFunction::apply(M); }

Tensor hencky_tensor(const Tensor& F) { return HenckyFunction::apply(F); }

Tensor polar_rotation(const Tensor& F, const SignedSvd& factors) {
  return PolarFunction::apply(F, factors.U.detach(), factors.sigma.detach(), factors.V.detach());
}

Tensor sinh_of(const Tensor& output) { return bounded(output, kernels::kSinhLimit).sinh(); }

Tensor bounded(const Tensor& output, double bound) { return output.clamp(-bound, bound); }

Tensor strain_measure(const Tensor& x, const Tensor& gamma, const Tensor& delta) {
  const Tensor y = bounded(gamma * x, kernels::kArgumentLimit), small = y.abs() < 1e-2;
  const Tensor far = torch::where(small, torch::ones_like(y), y), y2 = y * y;
  const Tensor series = 1 + y2 / 6 * (1 + y2 / 20 * (1 + y2 / 42 * (1 + y2 / 72)));
  const Tensor ratio = torch::where(small, series, far.sinh() / far);
  return x * bounded(delta * x, kernels::kArgumentLimit).exp() * ratio;
}

Tensor flow_exponent(const Tensor& output) {
  constexpr double kLimit = kernels::kFlowPowerLimit;
  return (kLimit * (output / kLimit).tanh()).exp();
}

Tensor relative_viscosity(const Tensor& v, const Tensor& factor) {
  return (v / factor).clamp_min(kernels::kLeastViscosity);
}

Tensor kept_excess(const Tensor& x, const Tensor& v, const Tensor& factor, const Tensor& p) {
  const double tiny = x.scalar_type() == torch::kFloat64
                          ? std::numeric_limits<double>::min()
                          : double(std::numeric_limits<float>::min());
  const Tensor powered = (v > tiny) & (x > tiny) & (p != 1), one = torch::ones_like(x * v * p);
  const Tensor excess = torch::where(powered, x, one), flow = torch::where(powered, v, one);
  const Tensor log_A = (p - 1) * ((excess / kernels::kFlowExcess).log() + flow.log1p()) +
                       factor.log() - p * flow.log();
  // w = log of the share that stays: log(e^w + A e^{pw}) = 0, by Newton's method; its last step
  // carries the derivative.
  Tensor w;
  {
    const torch::NoGradGuard no_grad;
    w = (-log_A / p).clamp_max(0);
    for (int i = 0; i < 9; ++i) {
      const Tensor a = w.exp(), b = (p * w + log_A).exp(), sum = a + b;
      w = (w - sum.log() * sum / (a + p * b)).clamp_max(0);
    }
  }
  const Tensor a = w.exp(), b = (p * w + log_A).exp(), sum = a + b;
  const Tensor share = (w - sum.log() * (sum / (a + p * b)).detach()).exp();
  const Tensor linear = relative_viscosity(v, factor);
  return torch::where(powered, excess * share, x * linear / (1 + linear));
}

}  // namespace uniphy::ops::reference
