#pragma once

#include <limits>

#include "ops/kernels/simd/mat3.hpp"

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
  return lane_fma(a(0, p), a(0, q), lane_fma(a(1, p), a(1, q), a(2, p) * a(2, q)));
}

/// A decomposition under way: F V = scale A.
template <class V>
struct Columns {
  Mat3<V> a, v;
  V scale;  ///< 0 where F vanishes
};
template <class V>
UNIPHY_INLINE Columns<V> scaled_columns(const Mat3<V>& F) {
  using T = ScalarOf<V>;
  const V one(T(1)), zero(T(0));
  V scale = lane_abs(F.e[0]);
  for (int k = 1; k < 9; ++k) scale = lane_max(scale, lane_abs(F.e[k]));
  // A denormal scale would overflow its reciprocal; such a matrix is zero for our purposes.
  const MaskOf<V> vanishing = scale < V(std::numeric_limits<T>::min() * T(16));
  scale = select<V>(vanishing, one, scale);
  return {F * (one / scale), identity3<V>(), select<V>(vanishing, zero, scale)};
}

/// One-sided Jacobi rotation of n vectors of matrices: makes columns p and q of A orthogonal, turns
/// V along. Returns whether any lane had something to do; converged lanes keep their values. The
/// products are fused by hand, so that the values do not depend on what a compiler fuses for one n.
template <int n, class V>
UNIPHY_INLINE bool rotate(Columns<V> (&columns)[n], int p, int q) {
  using T = ScalarOf<V>;
  const V one(T(1)), zero(T(0));
  // Converged: orthogonal to rounding of the dot product, or (entries being at most 1) so far below
  // rounding of the matrix that a rank-deficient F would be rotated down to denormals for nothing.
  const V eps2(std::numeric_limits<T>::epsilon() * std::numeric_limits<T>::epsilon());
  V alpha[n], beta[n], gamma[n];
  MaskOf<V> active[n], any_active;
#pragma GCC unroll 4
  for (int k = 0; k < n; ++k) {
    const Mat3<V>& a = columns[k].a;
    alpha[k] = column_dot(a, p, p);
    beta[k] = column_dot(a, q, q);
    gamma[k] = column_dot(a, p, q);
    active[k] = gamma[k] * gamma[k] > eps2 * lane_fma(V(T(4)) * alpha[k], beta[k], eps2);
    any_active = k == 0 ? active[k] : any_active || active[k];
  }
  if (!any<V>(any_active)) return false;
#pragma GCC unroll 4
  for (int k = 0; k < n; ++k) {
    Mat3<V>&a = columns[k].a, &v = columns[k].v;
    // The smaller root of t² + 2ζt − 1 = 0, ζ = h/γ, is t = ±γ/r with r = |h| + √(h² + γ²), and
    // (cos, sin) = (r, ±γ)/√(r² + γ²). γ² of an active lane is far from underflow.
    const V h = (beta[k] - alpha[k]) * V(T(0.5)), square = gamma[k] * gamma[k];
    const V r = lane_abs(h) + lane_sqrt(lane_fma(h, h, square));
    const V inverse = one / lane_sqrt(lane_fma(r, r, square));
    const V turn = select<V>(h < zero, -gamma[k], gamma[k]);
    const V c = select<V>(active[k], r * inverse, one);
    const V s = select<V>(active[k], turn * inverse, zero);
    for (int i = 0; i < 3; ++i) {
      const V ap = a(i, p), aq = a(i, q), vp = v(i, p), vq = v(i, q);
      a(i, p) = lane_fma(c, ap, -(s * aq));
      a(i, q) = lane_fma(s, ap, c * aq);
      v(i, p) = lane_fma(c, vp, -(s * vq));
      v(i, q) = lane_fma(s, vp, c * vq);
    }
  }
  return true;
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

/// U by Gram–Schmidt on the ordered columns, so that it is a rotation even where columns vanish.
template <class V>
UNIPHY_INLINE Svd3<V> factors(Columns<V> columns) {
  using T = ScalarOf<V>;
  const V one(T(1)), zero(T(0));
  Mat3<V>&a = columns.a, &v = columns.v;
  Vec3<V> norm2{{column_dot(a, 0, 0), column_dot(a, 1, 1), column_dot(a, 2, 2)}};
  order(a, v, norm2, 0, 1);
  order(a, v, norm2, 0, 2);
  order(a, v, norm2, 1, 2);

  Svd3<V> r;
  const V tiny(std::numeric_limits<T>::min());
  const V s0 = lane_sqrt(norm2[0]);
  const MaskOf<V> ok0 = s0 > tiny;
  const V inv0 = one / select<V>(ok0, s0, one);
  Vec3<V> u0{{select<V>(ok0, a(0, 0) * inv0, one), select<V>(ok0, a(1, 0) * inv0, zero),
              select<V>(ok0, a(2, 0) * inv0, zero)}};
  Vec3<V> a1{{a(0, 1), a(1, 1), a(2, 1)}};
  const V along = dot(u0, a1);
  Vec3<V> w;
  for (int i = 0; i < 3; ++i) w[i] = lane_fma(-along, u0[i], a1[i]);
  const V w2 = dot(w, w);
  // Below rounding of the first column the direction is noise: take any unit vector normal to u0.
  // (Columns that are orthogonal lose nothing of their length here, noise most of it: ¼ of the
  // square tells them apart. `other` is at least 0.6 long on either side of 0.6.)
  const MaskOf<V> ok1 = w2 > V(std::numeric_limits<T>::min()) && w2 > norm2[1] * V(T(0.25));
  const MaskOf<V> x_small = lane_abs(u0[0]) < V(T(0.6));
  Vec3<V> other{{select<V>(x_small, zero, -u0[2]), select<V>(x_small, -u0[2], zero),
                 select<V>(x_small, u0[1], u0[0])}};
  for (int i = 0; i < 3; ++i) w[i] = select<V>(ok1, w[i], other[i]);
  const V inv1 = one / lane_sqrt(dot(w, w));
  Vec3<V> u1{{w[0] * inv1, w[1] * inv1, w[2] * inv1}};
  // A second pass removes what cancellation left of u0: some units of rounding, and of the length
  // only their square.
  const V again = dot(u0, u1);
  for (int i = 0; i < 3; ++i) u1[i] = lane_fma(-again, u0[i], u1[i]);
  // Where w is not the column itself but any normal of u0, the sign is free: sigma[1] is not
  // negative.
  const MaskOf<V> opposite = dot(u1, a1) < zero;
  for (int i = 0; i < 3; ++i) u1[i] = select<V>(opposite, -u1[i], u1[i]);
  Vec3<V> u2;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    u2[i] = lane_fma(u0[j], u1[k], -(u0[k] * u1[j]));
  }
  for (int i = 0; i < 3; ++i) {
    r.U(i, 0) = u0[i];
    r.U(i, 1) = u1[i];
    r.U(i, 2) = u2[i];
  }
  r.V_ = v;
  r.sigma[0] = s0 * columns.scale;
  r.sigma[1] = dot(u1, a1) * columns.scale;
  r.sigma[2] = lane_fma(u2[0], a(0, 2), lane_fma(u2[1], a(1, 2), u2[2] * a(2, 2))) * columns.scale;
  return r;
}

}  // namespace svd_detail

/// One-sided Jacobi (Hestenes): it works on the columns of F, never on FᵀF, so small singular
/// values keep their relative accuracy. Sweeps stop when every lane is orthogonal to rounding.
/// Every finite F, singular or inverted, has an answer; F is rescaled, so entries may be as large
/// as sqrt(max) and as small as sqrt(min) without loss. A rotation is a chain of roots and a
/// quotient, each of which waits for the last; with n vectors side by side they fill each other's
/// gaps, and each gets the values that it would get alone.
/// G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., section 8.6.3.
template <int n, class V>
UNIPHY_NOINLINE void svd3(const Mat3<V> (&F)[n], Svd3<V> (&svd)[n]) {
  svd_detail::Columns<V> columns[n];
#pragma GCC unroll 4
  for (int k = 0; k < n; ++k) columns[k] = svd_detail::scaled_columns(F[k]);
  // Measured: of 3.4e5 random, singular, inverted and nearly equal matrices of either precision
  // none had work for more than 4 sweeps. The rest is room, for one that never settles.
  constexpr int kMaxSweeps = 12;
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    bool turned = svd_detail::rotate(columns, 0, 1);
    turned |= svd_detail::rotate(columns, 0, 2);
    turned |= svd_detail::rotate(columns, 1, 2);
    if (!turned) break;
  }
#pragma GCC unroll 4
  for (int k = 0; k < n; ++k) svd[k] = svd_detail::factors(columns[k]);
}
template <class V>
UNIPHY_INLINE Svd3<V> svd3(const Mat3<V>& F) {
  const Mat3<V> one[1] = {F};
  Svd3<V> svd[1];
  svd3(one, svd);
  return svd[0];
}

/// Adjoint of the factors themselves, for the published form of the law, which feeds U, Σ and Vᵀ to
/// a network. The exact derivative holds 1/(σj² − σi²), which is unbounded where singular values
/// meet and where U and V are not unique. It is replaced by d/(d² + ε²σ⁴) with ε = 1e-6 (float64)
/// or 1e-3 (float32) and σ the largest singular value: exact to (ε σ²/d)² away from equal values,
/// bounded by 1/(2εσ²), and zero at d = 0; σ² counts as 1e-8 at least, so that F = 0 has an answer.
/// Isotropic functions of F must not go through here; use spectral.hpp.
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
      const V inv = d / lane_fma(d, d, floor * floor);
      // Ω_ij = (σj B_ij + σi B_ji) inv,  Ψ_ij = (σi B_ij + σj B_ji) inv
      const V om = (P(i, j) - P(j, i)) * inv, ps = (Q(i, j) - Q(j, i)) * inv;
      A(i, j) = om * s.sigma[j] + ps * s.sigma[i];
      A(j, i) = om * s.sigma[i] + ps * s.sigma[j];
    }
  return mult(mul(s.U, A), s.V_);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
