#pragma once

#include "ops/kernels/spectral/limits.hpp"
#include "ops/kernels/spectral/svd3.hpp"

// Isotropic functions of F and their adjoints by divided differences.
//
//   R(F) = U diag(r(σ)) Vᵀ            (return mappings)
//   T(F) = U diag(t(σ)) Uᵀ, symmetric (strains and stresses)
//
// With B = Uᵀ dF V, the differential of R in the frame (U, V) is, off the diagonal,
//   ½ (ri−rj)/(σi−σj) (B_ij + B_ji) + ½ (ri+rj)/(σi+σj) (B_ij − B_ji),
// and that of T in the frame (U, U) is (ti−tj)/(σi²−σj²) (σj B_ij + σi B_ji). Neither holds a
// derivative of U or V, so both are finite and exact at equal singular values. Sums σi + σj, which
// vanish only for an inverted F whose rotation jumps, are bounded away from zero.
// See A. Stomakhin et al., Energetically consistent invertible elasticity, SCA 2012;
// R. A. Horn, C. R. Johnson, Topics in Matrix Analysis, section 6.6.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

inline constexpr int kPair[3][2] = {{0, 1}, {0, 2}, {1, 2}};

/// 1/(σi + σj), the sum bounded away from zero by kLeastSum.
template <class V>
UNIPHY_INLINE V inverse_sum(const V& a, const V& b) {
  using T = ScalarOf<V>;
  const V floor = V(T(kLeastSum));
  const V s = a + b;
  const V magnitude = lane_max(floor, lane_abs(s));
  return V(T(1)) / select<V>(s < V(T(0)), -magnitude, magnitude);
}

/// (log a − log b)/(a − b) for a, b > 0, to rounding at any gap: 2 atanh(r)/r/(a+b) with
/// r = (a−b)/(a+b), by series where r is small.
template <class V>
UNIPHY_INLINE V log_divided_difference(const V& a, const V& b, const V& log_a, const V& log_b) {
  using T = ScalarOf<V>;
  const V one(T(1));
  const V d = a - b, s = one / (a + b), r = d * s, r2 = r * r;
  // Seven terms reach 1e-16 relative below |r| = 0.1.
  V series(T(1.0 / 15));
  series = lane_fma(series, r2, V(T(1.0 / 13)));
  series = lane_fma(series, r2, V(T(1.0 / 11)));
  series = lane_fma(series, r2, V(T(1.0 / 9)));
  series = lane_fma(series, r2, V(T(1.0 / 7)));
  series = lane_fma(series, r2, V(T(1.0 / 5)));
  series = lane_fma(series, r2, V(T(1.0 / 3)));
  series = lane_fma(series, r2, one);
  const auto near = lane_abs(r) < V(T(0.1));
  return select<V>(near, (s + s) * series, (log_a - log_b) / select<V>(near, one, d));
}

/// (exp a − exp b)/(a − b) given both exponentials: exp((a+b)/2) sinhc((a−b)/2).
template <class V>
UNIPHY_INLINE V exp_divided_difference(const V& a, const V& b, const V& exp_a, const V& exp_b) {
  using T = ScalarOf<V>;
  const V one(T(1));
  // Six terms of sinhc reach 1e-17 at |h| = 1/4.
  const V d = a - b, h = d * V(T(0.5)), h2 = h * h;
  V series(T(1.0 / 39916800));
  series = lane_fma(series, h2, V(T(1.0 / 362880)));
  series = lane_fma(series, h2, V(T(1.0 / 5040)));
  series = lane_fma(series, h2, V(T(1.0 / 120)));
  series = lane_fma(series, h2, V(T(1.0 / 6)));
  series = lane_fma(series, h2, one);
  const auto near = lane_abs(d) < V(T(0.5));
  return select<V>(near, lane_sqrt(exp_a * exp_b) * series,
                   (exp_a - exp_b) / select<V>(near, one, d));
}

/// The Hencky strain of the clamped singular values, ε = log max(σ, 0.05), with its invariants.
template <class V>
struct HenckyStrain {
  Vec3<V> stretch;   ///< max(σ, 0.05)
  Vec3<V> eps;       ///< ε
  Vec3<V> deviator;  ///< ε̂ = ε − tr(ε)/3
  V trace;           ///< tr ε
  V norm;            ///< q = ‖ε̂‖
  Vec3<V> slope;     ///< dε_i/dσ_i, 0 where clamped
  Vec3<V> divided;   ///< (ε_i − ε_j)/(σ_i − σ_j) for the pairs kPair
};

/// `gradients` also fills slope and divided.
template <class V>
UNIPHY_INLINE HenckyStrain<V> hencky_strain(const Vec3<V>& sigma, bool gradients) {
  using T = ScalarOf<V>;
  const T least = T(kMinimumStretch);
  const V floor(least), one(T(1)), zero(T(0));
  HenckyStrain<V> h;
  for (int i = 0; i < 3; ++i) {
    h.stretch[i] = lane_max(floor, sigma[i]);
    h.eps[i] = lane_log(h.stretch[i]);
  }
  h.trace = sum(h.eps);
  const V mean = h.trace * V(T(1.0 / 3));
  for (int i = 0; i < 3; ++i) h.deviator[i] = h.eps[i] - mean;
  h.norm = lane_sqrt(dot(h.deviator, h.deviator));
  if (gradients) {
    for (int i = 0; i < 3; ++i) h.slope[i] = select<V>(sigma[i] > floor, one / h.stretch[i], zero);
    for (int k = 0; k < 3; ++k) {
      const int i = kPair[k][0], j = kPair[k][1];
      const V of_stretch = log_divided_difference(h.stretch[i], h.stretch[j], h.eps[i], h.eps[j]);
      // (stretch_i − stretch_j)/(σ_i − σ_j) is 1 above the clamp and 0 below it.
      const V gap = sigma[i] - sigma[j];
      const auto clamped = sigma[j] < floor;
      const auto apart = lane_abs(gap) > zero;
      const V ratio = (h.stretch[i] - h.stretch[j]) / select<V>(apart, gap, one);
      h.divided[k] = of_stretch * select<V>(clamped, select<V>(apart, ratio, zero), one);
    }
  }
  return h;
}

/// y_i = stretching · ε̂_i + trace/3, the logarithms of the projected singular values of every
/// return mapping that scales the deviator and sets the trace.
template <class V>
struct LogMap {
  V scale;            ///< multiplies the deviator
  V trace;            ///< tr of the projected strain
  Vec3<V> log_sigma;  ///< y
  Vec3<V> sigma;      ///< exp y
};

template <class V>
UNIPHY_INLINE LogMap<V> log_map(const HenckyStrain<V>& h, const V& scale, const V& trace) {
  using T = ScalarOf<V>;
  LogMap<V> m;
  m.scale = scale;
  m.trace = trace;
  const V mean = trace * V(T(1.0 / 3));
  for (int i = 0; i < 3; ++i) {
    m.log_sigma[i] = lane_fma(scale, h.deviator[i], mean);
    m.sigma[i] = lane_exp(m.log_sigma[i]);
  }
  return m;
}

/// Adjoint of R(F) = U exp(y) Vᵀ. A = Uᵀ (dL/dR) V. Returns dL/dF in the frame, off-diagonal part
/// complete; on its diagonal nothing yet. grad_scale, grad_trace are dL/d(scale, trace) and
/// grad_deviator is dL/dε̂ through y alone, for the law to add its own invariants to; close it with
/// add_strain_gradient.
template <class V>
UNIPHY_INLINE Mat3<V> log_map_adjoint(const HenckyStrain<V>& h, const Vec3<V>& sigma,
                                      const LogMap<V>& m, const Mat3<V>& A, V& grad_scale,
                                      V& grad_trace, Vec3<V>& grad_deviator) {
  using T = ScalarOf<V>;
  const V half(T(0.5));
  Mat3<V> B = zero3<V>();
  Vec3<V> gy;
  for (int i = 0; i < 3; ++i) gy[i] = A(i, i) * m.sigma[i];
  grad_scale = dot(gy, h.deviator);
  grad_trace = sum(gy) * V(T(1.0 / 3));
  for (int i = 0; i < 3; ++i) grad_deviator[i] = gy[i] * m.scale;
  for (int k = 0; k < 3; ++k) {
    const int i = kPair[k][0], j = kPair[k][1];
    const V of_log = exp_divided_difference(m.log_sigma[i], m.log_sigma[j], m.sigma[i], m.sigma[j]);
    const V difference = of_log * m.scale * h.divided[k];
    const V quotient = (m.sigma[i] + m.sigma[j]) * inverse_sum(sigma[i], sigma[j]);
    const V s = (A(i, j) + A(j, i)) * half * difference;
    const V a = (A(i, j) - A(j, i)) * half * quotient;
    B(i, j) = s + a;
    B(j, i) = s - a;
  }
  return B;
}

/// Adds dL/dε̂ and dL/d(tr ε) to the diagonal of the frame gradient B.
template <class V>
UNIPHY_INLINE void add_strain_gradient(const HenckyStrain<V>& h, const Vec3<V>& grad_deviator,
                                       const V& grad_trace, Mat3<V>& B) {
  using T = ScalarOf<V>;
  const V shift = grad_trace - sum(grad_deviator) * V(T(1.0 / 3));
  for (int i = 0; i < 3; ++i) B(i, i) = lane_fma(grad_deviator[i] + shift, h.slope[i], B(i, i));
}

/// Adds the off-diagonal adjoint of T(F) = U diag(t) Uᵀ to the frame gradient B, given
/// S = Uᵀ sym(dL/dT) U and the divided differences d_k = (t_i − t_j)/(σ_i − σ_j). The diagonal,
/// S_ii dt_i/dσ, is the caller's.
template <class V>
UNIPHY_INLINE void add_symmetric_adjoint(const Vec3<V>& sigma, const Vec3<V>& divided,
                                         const Mat3<V>& S, Mat3<V>& B) {
  for (int k = 0; k < 3; ++k) {
    const int i = kPair[k][0], j = kPair[k][1];
    const V c = (S(i, j) + S(j, i)) * divided[k] * inverse_sum(sigma[i], sigma[j]);
    B(i, j) = lane_fma(c, sigma[j], B(i, j));
    B(j, i) = lane_fma(c, sigma[i], B(j, i));
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
