#include "ops/reference/signed_svd.hpp"

#include <array>
#include <limits>

#include "ops/base/torch.hpp"

namespace uniphy::ops::reference {

using torch::Tensor;

namespace {

using Columns = std::array<Tensor, 3>;  // each [P, 3]

Columns columns(const Tensor& m) { return {m.select(2, 0), m.select(2, 1), m.select(2, 2)}; }
Tensor matrix(const Columns& c) { return torch::stack({c[0], c[1], c[2]}, 2); }
/// [P, 1]
Tensor column_dot(const Tensor& a, const Tensor& b) { return (a * b).sum(1, /*keepdim=*/true); }

/// Makes columns p and q of a orthogonal, turns v along; returns whether any row had to move.
bool rotate(Columns& a, Columns& v, int p, int q, double eps2) {
  const Tensor alpha = column_dot(a[p], a[p]), beta = column_dot(a[q], a[q]),
               gamma = column_dot(a[p], a[q]);
  const Tensor active = gamma * gamma > eps2 * (4 * alpha * beta + eps2);
  if (!active.any().item<bool>()) return false;
  const Tensor zeta = (beta - alpha) / (2 * torch::where(active, gamma, torch::ones_like(gamma)));
  const Tensor magnitude = 1 / (zeta.abs() + (zeta * zeta + 1).sqrt());
  const Tensor t = torch::where(zeta < 0, -magnitude, magnitude) * active;
  const Tensor c = 1 / (t * t + 1).sqrt(), s = c * t;
  for (Columns* m : {&a, &v}) {
    const Tensor mp = (*m)[p], mq = (*m)[q];
    (*m)[p] = c * mp - s * mq;
    (*m)[q] = s * mp + c * mq;
  }
  return true;
}

/// Exchanges columns p < q where the second is longer; the sign keeps det V = 1.
void order(Columns& a, Columns& v, int p, int q) {
  const Tensor swap = column_dot(a[q], a[q]) > column_dot(a[p], a[p]);
  for (Columns* m : {&a, &v}) {
    const Tensor mp = (*m)[p], mq = (*m)[q];
    (*m)[p] = torch::where(swap, mq, mp);
    (*m)[q] = torch::where(swap, -mp, mq);
  }
}

SignedSvd factorise(const Tensor& F) {
  const bool wide = F.scalar_type() == torch::kFloat64;
  const double eps =
      wide ? std::numeric_limits<double>::epsilon() : double(std::numeric_limits<float>::epsilon());
  const double tiny =
      wide ? std::numeric_limits<double>::min() : double(std::numeric_limits<float>::min());
  Tensor scale = F.abs().amax({1, 2}, /*keepdim=*/true);  // [P, 1, 1]
  const Tensor vanishing = scale < 16 * tiny;
  scale = scale.masked_fill(vanishing, 1);
  Columns a = columns(F / scale);
  Columns v = columns(torch::eye(3, F.options()).expand_as(F));
  for (int sweep = 0; sweep < 12; ++sweep) {
    bool moved = rotate(a, v, 0, 1, eps * eps);
    moved = rotate(a, v, 0, 2, eps * eps) || moved;
    moved = rotate(a, v, 1, 2, eps * eps) || moved;
    if (!moved) break;
  }
  order(a, v, 0, 1);
  order(a, v, 0, 2);
  order(a, v, 1, 2);

  // U by Gram–Schmidt, so that it is a rotation even where columns vanish.
  const Tensor s0 = column_dot(a[0], a[0]).sqrt();
  const Tensor x_axis = torch::eye(3, F.options())[0].expand_as(a[0]);
  const Tensor u0 = torch::where(s0 > tiny, a[0] / s0.clamp_min(tiny), x_axis);
  const Tensor norm2 = column_dot(a[1], a[1]);
  Tensor w = a[1] - column_dot(u0, a[1]) * u0;
  const Tensor w2 = column_dot(w, w);
  // Below rounding of the first column the direction is noise: any normal of u0 will do.
  const Tensor x = u0.slice(1, 0, 1), y = u0.slice(1, 1, 2), z = u0.slice(1, 2, 3);
  const Tensor zero = torch::zeros_like(x);
  const Tensor other =
      torch::where(x.abs() < 0.6, torch::cat({zero, -z, y}, 1), torch::cat({-z, zero, x}, 1));
  w = torch::where((w2 > tiny) & (w2 > 0.25 * norm2), w, other);
  Tensor u1 = w / column_dot(w, w).sqrt();
  u1 = u1 - column_dot(u0, u1) * u0;
  u1 = u1 / column_dot(u1, u1).sqrt();
  u1 = torch::where(column_dot(u1, a[1]) < 0, -u1, u1);
  const Tensor u2 = torch::linalg_cross(u0, u1);
  const Tensor sigma = torch::cat({s0, column_dot(u1, a[1]), column_dot(u2, a[2])}, 1);
  return {matrix({u0, u1, u2}), (sigma * scale.squeeze(2)).masked_fill(vanishing.squeeze(2), 0),
          matrix(v)};
}

class SignedSvdFunction : public torch::autograd::Function<SignedSvdFunction> {
 public:
  static torch::autograd::variable_list forward(torch::autograd::AutogradContext* ctx,
                                                const Tensor& F) {
    const SignedSvd s = factorise(F);
    ctx->save_for_backward({s.U, s.sigma, s.V});
    return {s.U, s.sigma, s.V};
  }

  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* ctx,
                                                 torch::autograd::variable_list grad) {
    const auto saved = ctx->get_saved_variables();
    const Tensor U = saved[0], sigma = saved[1], V = saved[2];
    const bool wide = U.scalar_type() == torch::kFloat64;
    // In units of the largest singular value.
    const Tensor top = sigma.slice(1, 0, 1).clamp_min(1e-4);
    const Tensor square = (sigma / top).square();
    const Tensor d = square.unsqueeze(1) - square.unsqueeze(2);  // (σj² − σi²)/σ²
    const double epsilon = wide ? 1e-6 : 1e-3;
    const Tensor inverse = d / (d * d + epsilon * epsilon) / top.unsqueeze(2);  // times σ
    const Tensor scaled = sigma / top;
    Tensor A = torch::zeros_like(U);
    if (grad[0].defined()) {
      const Tensor P = U.mT().matmul(grad[0]);
      A = A + (P - P.mT()) * inverse * scaled.unsqueeze(1);
    }
    if (grad[2].defined()) {
      const Tensor Q = V.mT().matmul(grad[2]);
      A = A + scaled.unsqueeze(2) * ((Q - Q.mT()) * inverse);
    }
    if (grad[1].defined()) A = A + torch::diag_embed(grad[1]);
    return {U.matmul(A).matmul(V.mT())};
  }
};

}  // namespace

SignedSvd signed_svd(const Tensor& F) {
  const auto r = SignedSvdFunction::apply(F);
  return {r[0], r[1], r[2]};
}

}  // namespace uniphy::ops::reference
