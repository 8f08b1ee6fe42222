#pragma once

#include "ops/kernels/learned/return_caps.hpp"
#include "ops/kernels/spectral/strain_measure.hpp"

// The stress of the isotropic form (formulas: isotropic_law.hpp): the features that its network
// sees, and the tensor basis whose coefficients the network answers with.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace isotropic_detail {

/// Features of the stress network and what its adjoint needs.
template <class V>
struct StressState {
  HenckyStrain<V> h;
  StrainInvariants<V> invariants;
  V volumetric;        ///< t'/e
  Mat3<V> rate;        ///< D̂ (world frame)
  Mat3<V> rate_frame;  ///< Uᵀ D̂ U
  V rate_trace;
  V rate_norm;          ///< sqrt(‖D̂‖² + d²) − d
  V inverse_rate_root;  ///< d(rate_norm)/dD̂ = D̂ inverse_rate_root
  V aligned;            ///< w:D̂
  V x;                  ///< aligned/(1 + rate_norm q)
  V spread;             ///< 1/(1 + q)
  Vec3<V> second;       ///< dev(w²)/(1 + q)
};
/// h: of the projected F; rate: D̂, and rate_frame the same in the frame U.
template <class V>
UNIPHY_INLINE StressState<V> stress_state(const HenckyStrain<V>& h, const Mat3<V>& rate,
                                          const V& rate_trace, const Mat3<V>& rate_frame,
                                          const V& inv_e) {
  using T = ScalarOf<V>;
  const V one(T(1)), third(T(1.0 / 3));
  StressState<V> s;
  s.h = h;
  s.invariants = strain_invariants(s.h, inv_e);
  s.volumetric = s.h.trace * inv_e;
  s.rate = rate;
  s.rate_trace = rate_trace;
  const V d = V(T(kInvariantSmoothing));
  const V rate_root = lane_sqrt(lane_fma(d, d, dot(s.rate, s.rate)));
  s.rate_norm = rate_root - d;
  s.inverse_rate_root = one / rate_root;
  s.rate_frame = rate_frame;
  const Vec3<V>& w = s.invariants.w;
  s.aligned = w[0] * s.rate_frame(0, 0) + w[1] * s.rate_frame(1, 1) + w[2] * s.rate_frame(2, 2);
  s.x = s.aligned / lane_fma(s.rate_norm, s.invariants.q, one);
  s.spread = one / (one + s.invariants.q);
  Vec3<V> w2;
  for (int i = 0; i < 3; ++i) w2[i] = w[i] * w[i];
  const V mean = sum(w2) * third;
  for (int i = 0; i < 3; ++i) s.second[i] = (w2[i] - mean) * s.spread;
  return s;
}
/// rate and rate_trace.
template <class V>
UNIPHY_INLINE void set_rate(const Mat3<V>& C, StressState<V>& s) {
  using T = ScalarOf<V>;
  s.rate = sym(C) * V(T(kTimeScale));
  s.rate_trace = trace(s.rate);
  const V mean = s.rate_trace * V(T(1.0 / 3));
  for (int k = 0; k < 9; k += 4) s.rate.e[k] = s.rate.e[k] - mean;
}
template <class V, class T>
UNIPHY_INLINE StressState<V> stress_state(const Mat3<V>& U, const Vec3<V>& sigma, const Mat3<V>& C,
                                          T strain_scale, bool gradients) {
  StressState<V> of;
  set_rate(C, of);
  return stress_state(hencky_strain(sigma, gradients), of.rate, of.rate_trace,
                      tmul(U, mul(of.rate, U)), V(T(1) / strain_scale));
}

/// An exponent: a network's output, bounded, and whether it is within the bound.
template <class V>
UNIPHY_INLINE V exponent_of(const V& output) {
  using T = ScalarOf<V>;
  return lane_max(lane_min(output, V(T(kExponentLimit))), V(T(-kExponentLimit)));
}
template <class V>
UNIPHY_INLINE V exponent_gradient(const V& output, const V& gradient) {
  using T = ScalarOf<V>;
  return select<V>(lane_abs(output) < V(T(kExponentLimit)), gradient, V(T(0)));
}

/// The coefficients of the tensor basis.
template <class V>
struct Coefficients {
  SinhOf<V> k, a1, b;
  V a0, a2, n, gamma, delta;
};
/// o: the stress network's outputs; `rest`: what a₀ has taken off.
template <class V>
UNIPHY_INLINE Coefficients<V> coefficients(const V (&o)[8], const V& rest) {
  return {sinh_of(o[0]), sinh_of(o[2]),     sinh_of(o[4]),     o[1] - rest,
          o[3],          exponent_of(o[5]), exponent_of(o[6]), exponent_of(o[7])};
}
/// `a`: the planes of the stress network's outputs from a lane on.
template <class V, class T>
UNIPHY_INLINE void load_outputs(const T* a, V (&o)[8]) {
  for (int k = 0; k < 8; ++k) o[k] = V::load_aligned(a + k * kTile);
}
template <class V, class T>
UNIPHY_INLINE Coefficients<V> coefficients(const LearnedLaw<T>& law, const T* a) {
  V o[8];
  load_outputs(a, o);
  return coefficients(o, V(law.rest_pressure));
}

/// The strain measures of one vector of particles.
template <class V>
struct Measures {
  StrainMeasure<V> volume;     ///< m(t; γ, δ)
  StrainMeasure<V> strain[3];  ///< m(ε_i; n/2, n/2)
};
template <class V>
UNIPHY_INLINE Measures<V> measures(const StressState<V>& s, const Coefficients<V>& c) {
  const V half = c.n * V(ScalarOf<V>(0.5));
  Measures<V> m;
  m.volume = strain_measure(s.h.trace, c.gamma, c.delta);
  for (int i = 0; i < 3; ++i) m.strain[i] = strain_measure(s.h.eps[i], half, half);
  return m;
}

/// The stress in units of s, but for b D̂: its diagonal in the frame U.
template <class V>
UNIPHY_INLINE Vec3<V> basis_diagonal(const StressState<V>& s, const Coefficients<V>& c,
                                     const Measures<V>& m, const V& inv_e) {
  using T = ScalarOf<V>;
  const V pressure = lane_fma(c.k.value * inv_e, m.volume.value,
                              lane_fma(c.b.value * s.rate_trace, V(T(1.0 / 3)), c.a0));
  const V a1 = c.a1.value * inv_e;
  Vec3<V> d;
  for (int i = 0; i < 3; ++i)
    d[i] = lane_fma(a1, m.strain[i].value, lane_fma(c.a2, s.second[i], pressure));
  return d;
}
/// The stress in units of s.
template <class V>
UNIPHY_INLINE Mat3<V> basis_stress(const StressState<V>& s, const Mat3<V>& U,
                                   const Coefficients<V>& c, const V& inv_e) {
  return compose(U, basis_diagonal(s, c, measures(s, c), inv_e), U) + s.rate * c.b.value;
}

/// dL/d(outputs of the stress network) and what they owe to the scales.
template <class V>
struct CoefficientGradients {
  V output[8];
  V log_s;  ///< dL/d(log s)
  V log_e;  ///< dL/d(log e) through the 1/e of k and a₁
  V a0;
};
/// S: dL/dτ s in the frame U, symmetric; of_rate: S : D̂; o: the network's outputs.
template <class V>
UNIPHY_INLINE CoefficientGradients<V> coefficient_gradients(const StressState<V>& s,
                                                            const Coefficients<V>& c,
                                                            const Measures<V>& m, const Mat3<V>& S,
                                                            const V& of_rate, const V (&o)[8],
                                                            const V& inv_e) {
  using T = ScalarOf<V>;
  const V zero(T(0));
  V g_a0 = zero, g_a1 = zero, g_a2 = zero, g_n = zero;
  for (int i = 0; i < 3; ++i) {
    g_a0 = g_a0 + S(i, i);
    g_a1 = lane_fma(S(i, i), m.strain[i].value * inv_e, g_a1);
    g_a2 = lane_fma(S(i, i), s.second[i], g_a2);
    g_n = lane_fma(S(i, i), m.strain[i].per_gamma + m.strain[i].per_delta, g_n);
  }
  const V g_k = g_a0 * m.volume.value * inv_e, g_volume = g_a0 * c.k.value * inv_e;
  const V g_b = of_rate + g_a0 * s.rate_trace * V(T(1.0 / 3));
  const V of_measures = g_k * c.k.value + g_a1 * c.a1.value;  // both go as 1/e
  return {{g_k * c.k.slope, g_a0, g_a1 * c.a1.slope, g_a2, g_b * c.b.slope,
           exponent_gradient(o[5], g_n * c.a1.value * inv_e * V(T(0.5))),
           exponent_gradient(o[6], g_volume * m.volume.per_gamma),
           exponent_gradient(o[7], g_volume * m.volume.per_delta)},
          of_measures + g_a0 * c.a0 + g_a2 * c.a2 + g_b * c.b.value,
          -of_measures,
          g_a0};
}

/// dL/dw, w = ε̂/e, through a₂ second(w) but for what `second` owes to q, which is added to g_q.
template <class V>
UNIPHY_INLINE Vec3<V> second_gradient(const StressState<V>& s, const V& a2, const Mat3<V>& S,
                                      V& g_q) {
  using T = ScalarOf<V>;
  const V mean_S = (S(0, 0) + S(1, 1) + S(2, 2)) * V(T(1.0 / 3));
  for (int i = 0; i < 3; ++i) g_q = g_q - S(i, i) * a2 * s.second[i] * s.spread;
  const V slope2 = V(T(2)) * a2 * s.spread;
  Vec3<V> gw;
  for (int i = 0; i < 3; ++i) gw[i] = slope2 * s.invariants.w[i] * (S(i, i) - mean_S);
  return gw;
}

/// What a gradient of the stress network's features, f, is to w:D̂, ‖D̂‖ and q.
template <class V>
struct FeatureGradients {
  V aligned, rate_norm, q;
};
template <class V>
UNIPHY_INLINE FeatureGradients<V> feature_gradients(const StressState<V>& s, const V (&f)[6]) {
  // x = aligned / (1 + n q)
  const V one(ScalarOf<V>(1)), q = s.invariants.q;
  const V inv_x = one / lane_fma(s.rate_norm, q, one);
  return {f[5] * inv_x, f[4] - f[5] * s.x * q * inv_x, f[1] - f[5] * s.x * s.rate_norm * inv_x};
}

}  // namespace isotropic_detail
}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
