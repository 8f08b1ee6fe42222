#pragma once

#include <limits>

#include "ops/kernels/mat3.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// F = U diag(sigma) Vᵀ with U, V rotations (det = +1) and |sigma| in decreasing order; the sign of
/// det F is carried by the last singular value.
template <class V>
struct Svd3 {
  Mat3<V> U;
  Vec3<V> sigma;
  Mat3<V> V_;
};

namespace svd_detail {

/// Scaled dot product of columns p and q.
template <class V>
UNIPHY_INLINE V column_dot(const Mat3<V>& a, int p, int q) {
  return fma(a(0, p), a(0, q), fma(a(1, p), a(1, q), a(2, p) * a(2, q)));
}

/// One-sided Jacobi rotation: makes columns p and q of A orthogonal, turns V along. Returns whether
/// each lane still had something to do; converged lanes keep their bits.
template <class V>
UNIPHY_INLINE MaskOf<V> rotate(Mat3<V>& a, Mat3<V>& v, int p, int q) {
  using T = ScalarOf<V>;
  const V one(T(1)), zero(T(0));
  const V alpha = column_dot(a, p, p), beta = column_dot(a, q, q), gamma = column_dot(a, p, q);
  // Converged: orthogonal to rounding of the dot product, or (entries being at most 1) so far below
  // rounding of the matrix that a rank-deficient F would be rotated down to denormals for nothing.
  const V eps2(std::numeric_limits<T>::epsilon() * std::numeric_limits<T>::epsilon());
  const MaskOf<V> active = gamma * gamma > eps2 * fma(V(T(4)) * alpha, beta, eps2);
  // The smaller root of t² + 2ζt − 1 = 0, ζ = h/γ, as t = ±γ/(|h| + √(h² + γ²)); positive at h = 0.
  // γ of an active lane is far from underflow.
  const V h = (beta - alpha) * V(T(0.5));
  const V reach = lane_abs(h) + lane_sqrt(fma(h, h, gamma * gamma));
  const V tied = select<V>(h < zero, -gamma, lane_abs(gamma));
  const V turn = select<V>(h > zero, gamma, tied) / select<V>(active, reach, one);
  const V t = select<V>(active, turn, zero);
  const V c = one / lane_sqrt(fma(t, t, one));
  const V s = c * t;
  for (int i = 0; i < 3; ++i) {
    const V ap = a(i, p), aq = a(i, q), vp = v(i, p), vq = v(i, q);
    a(i, p) = c * ap - s * aq;
    a(i, q) = s * ap + c * aq;
    v(i, p) = c * vp - s * vq;
    v(i, q) = s * vp + c * vq;
  }
  return active;
}

/// Exchanges columns p < q where the norm of q is larger; the sign keeps det V = +1.
template <class V>
UNIPHY_INLINE void order(Mat3<V>& a, Mat3<V>& v, Vec3<V>& norm2, int p, int q) {
  const MaskOf<V> swap = norm2[q] > norm2[p];
  for (int i = 0; i < 3; ++i) {
    const V ap = a(i, p), aq = a(i, q), vp = v(i, p), vq = v(i, q);
    a(i, p) = select<V>(swap, aq, ap);
    a(i, q) = select<V>(swap, -ap, aq);
    v(i, p) = select<V>(swap, vq, vp);
    v(i, q) = select<V>(swap, -vp, vq);
  }
  const V np = norm2[p], nq = norm2[q];
  norm2[p] = select<V>(swap, nq, np);
  norm2[q] = select<V>(swap, np, nq);
}

}  // namespace svd_detail

/// One-sided Jacobi (Hestenes): it works on the columns of F, never on FᵀF, so small singular
/// values keep their relative accuracy. Sweeps stop when every lane is orthogonal to rounding.
/// Every finite F, singular or inverted, has an answer; F is rescaled, so entries may be as large
/// as sqrt(max) and as small as sqrt(min) without loss.
/// G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., section 8.6.3.
template <class V>
UNIPHY_NOINLINE Svd3<V> svd3(const Mat3<V>& F) {
  using T = ScalarOf<V>;
  const V one(T(1)), zero(T(0));
  V scale = lane_abs(F.e[0]);
  for (int k = 1; k < 9; ++k) scale = lane_max(scale, lane_abs(F.e[k]));
  // A denormal scale would overflow its reciprocal; such a matrix is zero for our purposes.
  const MaskOf<V> vanishing = scale < V(std::numeric_limits<T>::min() * T(16));
  scale = select<V>(vanishing, one, scale);
  Mat3<V> a = F * (one / scale);
  Mat3<V> v = identity3<V>();
  constexpr int kMaxSweeps = 12;
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    const MaskOf<V> m01 = svd_detail::rotate(a, v, 0, 1);
    const MaskOf<V> m02 = svd_detail::rotate(a, v, 0, 2);
    const MaskOf<V> m12 = svd_detail::rotate(a, v, 1, 2);
    if (!any<V>(m01 || m02 || m12)) break;
  }
  Vec3<V> norm2{{svd_detail::column_dot(a, 0, 0), svd_detail::column_dot(a, 1, 1),
                 svd_detail::column_dot(a, 2, 2)}};
  svd_detail::order(a, v, norm2, 0, 1);
  svd_detail::order(a, v, norm2, 0, 2);
  svd_detail::order(a, v, norm2, 1, 2);

  // U by Gram–Schmidt on the ordered columns, so that it is a rotation even where columns vanish.
  Svd3<V> r;
  const V tiny(std::numeric_limits<T>::min());
  const V s0 = lane_sqrt(norm2[0]);
  const MaskOf<V> ok0 = s0 > tiny;
  const V inv0 = one / select<V>(ok0, s0, one);
  Vec3<V> u0{{select<V>(ok0, a(0, 0) * inv0, one), select<V>(ok0, a(1, 0) * inv0, zero),
              select<V>(ok0, a(2, 0) * inv0, zero)}};
  Vec3<V> a1{{a(0, 1), a(1, 1), a(2, 1)}};
  const V along = dot(u0, a1);
  Vec3<V> w{{a1[0] - along * u0[0], a1[1] - along * u0[1], a1[2] - along * u0[2]}};
  const V w2 = dot(w, w);
  // Below rounding of the first column the direction is noise: take any unit vector normal to u0.
  const MaskOf<V> ok1 = w2 > V(std::numeric_limits<T>::min()) && w2 > norm2[1] * V(T(0.25));
  const MaskOf<V> x_small = lane_abs(u0[0]) < V(T(0.6));
  Vec3<V> other{{select<V>(x_small, zero, -u0[2]), select<V>(x_small, -u0[2], zero),
                 select<V>(x_small, u0[1], u0[0])}};
  for (int i = 0; i < 3; ++i) w[i] = select<V>(ok1, w[i], other[i]);
  V inv1 = one / lane_sqrt(dot(w, w));
  Vec3<V> u1{{w[0] * inv1, w[1] * inv1, w[2] * inv1}};
  // A second pass removes what cancellation left of u0.
  const V again = dot(u0, u1);
  for (int i = 0; i < 3; ++i) u1[i] = u1[i] - again * u0[i];
  inv1 = one / lane_sqrt(dot(u1, u1));
  for (int i = 0; i < 3; ++i) u1[i] = u1[i] * inv1;
  // Where w is not the column itself but any normal of u0, the sign is free: sigma[1] is not
  // negative.
  const MaskOf<V> opposite = dot(u1, a1) < zero;
  for (int i = 0; i < 3; ++i) u1[i] = select<V>(opposite, -u1[i], u1[i]);
  const Vec3<V> u2{{u0[1] * u1[2] - u0[2] * u1[1], u0[2] * u1[0] - u0[0] * u1[2],
                    u0[0] * u1[1] - u0[1] * u1[0]}};
  for (int i = 0; i < 3; ++i) {
    r.U(i, 0) = u0[i];
    r.U(i, 1) = u1[i];
    r.U(i, 2) = u2[i];
  }
  r.V_ = v;
  const V live = select<V>(vanishing, zero, scale);
  r.sigma[0] = s0 * live;
  r.sigma[1] = dot(u1, a1) * live;
  r.sigma[2] = fma(u2[0], a(0, 2), fma(u2[1], a(1, 2), u2[2] * a(2, 2))) * live;
  return r;
}

/// Adjoint of the factors themselves, for the seed form of the law, which feeds U, Σ and Vᵀ to a
/// network. The exact derivative holds 1/(σj² − σi²), which is unbounded where singular values meet
/// and where U and V are not unique. It is replaced by d/(d² + ε²σ⁴) with ε = 1e-6 (float64) or
/// 1e-3 (float32) and σ the largest singular value: exact to (ε σ²/d)² away from equal values,
/// bounded by 1/(2εσ²), and zero at d = 0. Isotropic functions of F must not go through here; use
/// spectral.hpp.
template <class V>
UNIPHY_INLINE Mat3<V> svd3_adjoint(const Svd3<V>& s, const Mat3<V>& grad_U,
                                   const Vec3<V>& grad_sigma, const Mat3<V>& grad_V) {
  using T = ScalarOf<V>;
  const V top = lane_max(s.sigma[0] * s.sigma[0], V(T(1e-8)));
  const V floor = V(T(sizeof(T) == 8 ? 1e-6 : 1e-3)) * top;
  // dU = U Ω, dV = V Ψ with Ω, Ψ antisymmetric; B = Uᵀ dF V.
  const Mat3<V> P = tmul(s.U, grad_U), Q = tmul(s.V_, grad_V);
  Mat3<V> A;
  for (int i = 0; i < 3; ++i) A(i, i) = grad_sigma[i];
  for (int i = 0; i < 3; ++i)
    for (int j = i + 1; j < 3; ++j) {
      const V d = (s.sigma[j] - s.sigma[i]) * (s.sigma[j] + s.sigma[i]);
      const V inv = d / fma(d, d, floor * floor);
      // Ω_ij = (σj B_ij + σi B_ji) inv,  Ψ_ij = (σi B_ij + σj B_ji) inv
      const V om = (P(i, j) - P(j, i)) * inv, ps = (Q(i, j) - Q(j, i)) * inv;
      A(i, j) = om * s.sigma[j] + ps * s.sigma[i];
      A(j, i) = om * s.sigma[i] + ps * s.sigma[j];
    }
  return mult(mul(s.U, A), s.V_);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
