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
  V rate_square;        ///< ‖D̂‖²
  V rate_norm;          ///< sqrt(‖D̂‖² + d²) − d
  V inverse_rate_root;  ///< d(rate_norm)/dD̂ = D̂ inverse_rate_root
  V aligned;            ///< w:D̂
  V x;                  ///< aligned/(1 + rate_norm q)
};
/// h: of the projected F; rate: D̂, and rate_frame the same in the frame U.
template <class V>
UNIPHY_INLINE StressState<V> stress_state(const HenckyStrain<V>& h, const Mat3<V>& rate,
                                          const V& rate_trace, const Mat3<V>& rate_frame,
                                          const V& inv_e) {
  using T = ScalarOf<V>;
  const V one(T(1));
  StressState<V> s;
  s.h = h;
  s.invariants = strain_invariants(s.h, inv_e);
  s.volumetric = s.h.trace * inv_e;
  s.rate = rate;
  s.rate_trace = rate_trace;
  const V d = V(T(kInvariantSmoothing));
  s.rate_square = dot(s.rate, s.rate);
  const V rate_root = lane_sqrt(lane_fma(d, d, s.rate_square));
  s.rate_norm = rate_root - d;
  s.inverse_rate_root = one / rate_root;
  s.rate_frame = rate_frame;
  const Vec3<V>& w = s.invariants.w;
  s.aligned = w[0] * s.rate_frame(0, 0) + w[1] * s.rate_frame(1, 1) + w[2] * s.rate_frame(2, 2);
  s.x = s.aligned / lane_fma(s.rate_norm, s.invariants.q, one);
  return s;
}
/// rate, rate_square and rate_trace.
template <class V>
UNIPHY_INLINE void set_rate(const Mat3<V>& C, StressState<V>& s) {
  using T = ScalarOf<V>;
  s.rate = sym(C) * V(T(kTimeScale));
  s.rate_trace = trace(s.rate);
  const V mean = s.rate_trace * V(T(1.0 / 3));
  for (int k = 0; k < 9; k += 4) s.rate.e[k] = s.rate.e[k] - mean;
  s.rate_square = dot(s.rate, s.rate);
}
template <class V, class T>
UNIPHY_INLINE StressState<V> stress_state(const Mat3<V>& U, const Vec3<V>& sigma, const Mat3<V>& C,
                                          T strain_scale, bool gradients) {
  StressState<V> of;
  set_rate(C, of);
  return stress_state(hencky_strain(sigma, gradients), of.rate, of.rate_trace,
                      tmul(U, mul(of.rate, U)), V(T(1) / strain_scale));
}

/// The coefficients of the tensor basis.
template <class V>
struct Coefficients {
  SinhOf<V> k, a1, a2, b, b1;
  V a0, n1, n2, gamma, delta;
  V omega, beta;
  V kappa2;  ///< exp(2 κ̃)
  V nu;
};
/// o: the stress network's outputs; `rest`: what a₀ has taken off.
template <class V>
UNIPHY_INLINE Coefficients<V> coefficients(const V (&o)[kStressOutputs], const V& rest) {
  Coefficients<V> c;
  c.k = sinh_of(o[kBulk]);
  c.a1 = sinh_of(o[kShear]);
  c.a2 = sinh_of(o[kSecondShear]);
  c.b = sinh_of(o[kViscosity]);
  c.b1 = sinh_of(o[kRateViscosity]);
  c.a0 = o[kPressure] - rest;
  c.n1 = bounded(o[kShearExponent], kExponentLimit);
  c.n2 = bounded(o[kSecondExponent], kExponentLimit);
  c.gamma = bounded(o[kVolumeGamma], kExponentLimit);
  c.delta = bounded(o[kVolumeDelta], kExponentLimit);
  c.omega = bounded(o[kIsochoricShare], kExponentLimit);
  c.beta = o[kBulkRateShare];
  const V kappa = bounded(o[kRateScale], kRateScaleLimit);
  c.kappa2 = lane_exp(kappa + kappa);
  c.nu = bounded(o[kRateExponent], kRateExponentLimit);
  return c;
}
/// `a`: the planes of the stress network's outputs from a lane on.
template <class V, class T>
UNIPHY_INLINE void load_outputs(const T* a, V (&o)[kStressOutputs]) {
  for (int k = 0; k < kStressOutputs; ++k) o[k] = V::load_aligned(a + k * kTile);
}
template <class V, class T>
UNIPHY_INLINE Coefficients<V> coefficients(const LearnedLaw<T>& law, const T* a) {
  V o[kStressOutputs];
  load_outputs(a, o);
  return coefficients(o, V(law.rest_pressure));
}

/// The strain measures of one vector of particles and its viscosity.
template <class V>
struct Measures {
  StrainMeasure<V> volume;    ///< m(t; γ, δ)
  StrainMeasure<V> first[3];  ///< m(x_i; n₁)
  StrainMeasure<V> second[3];
  Vec3<V> stress;    ///< (a₁ m(x_i; n₁) + a₂ m(x_i; n₂))/e
  V mean;            ///< of `stress`
  V base, log_base;  ///< 1 + κ² ‖D̂‖²
  V power;           ///< base^ν
  V viscosity;       ///< b + b₁ base^ν
};
template <class V>
UNIPHY_INLINE Measures<V> measures(const StressState<V>& s, const Coefficients<V>& c,
                                   const V& inv_e) {
  using T = ScalarOf<V>;
  const V half(T(0.5)), third(T(1.0 / 3)), half1 = c.n1 * half, half2 = c.n2 * half;
  const V a1 = c.a1.value * inv_e, a2 = c.a2.value * inv_e;
  const V left_out = c.omega * s.h.trace * third;
  Measures<V> m;
  m.volume = strain_measure(s.h.trace, c.gamma, c.delta);
  for (int i = 0; i < 3; ++i) {
    const V x = s.h.eps[i] - left_out;
    m.first[i] = strain_measure(x, half1, half1);
    m.second[i] = strain_measure(x, half2, half2);
    m.stress[i] = lane_fma(a1, m.first[i].value, a2 * m.second[i].value);
  }
  m.mean = sum(m.stress) * third;
  m.base = lane_fma(c.kappa2, s.rate_square, V(T(1)));
  m.log_base = lane_log(m.base);
  m.power = lane_exp(c.nu * m.log_base);
  m.viscosity = lane_fma(c.b1.value, m.power, c.b.value);
  return m;
}

/// The viscous pressure per unit of tr D/3.
template <class V>
UNIPHY_INLINE V bulk_viscosity(const Coefficients<V>& c) {
  return c.b.value * (V(ScalarOf<V>(1)) - c.beta);
}

/// The stress in units of s, but for the viscous deviator: its diagonal in the frame U.
template <class V>
UNIPHY_INLINE Vec3<V> basis_diagonal(const StressState<V>& s, const Coefficients<V>& c,
                                     const Measures<V>& m, const V& inv_e) {
  using T = ScalarOf<V>;
  const V pressure = lane_fma(c.k.value * inv_e, m.volume.value,
                              lane_fma(bulk_viscosity(c) * s.rate_trace, V(T(1.0 / 3)), c.a0)) -
                     c.omega * m.mean;
  Vec3<V> d;
  for (int i = 0; i < 3; ++i) d[i] = m.stress[i] + pressure;
  return d;
}
/// The stress in units of s.
template <class V>
UNIPHY_INLINE Mat3<V> basis_stress(const StressState<V>& s, const Mat3<V>& U,
                                   const Coefficients<V>& c, const V& inv_e) {
  const Measures<V> m = measures(s, c, inv_e);
  return compose(U, basis_diagonal(s, c, m, inv_e), U) + s.rate * m.viscosity;
}

/// dL/d(outputs of the stress network) and what they owe to the scales.
template <class V>
struct CoefficientGradients {
  V output[kStressOutputs];
  V log_s;  ///< dL/d(log s)
  V log_e;  ///< dL/d(log e) through the 1/e of k, a₁ and a₂
  V a0;
  Vec3<V> strain;  ///< dL/dx_i
  V volume;        ///< dL/dt through m(t; γ, δ)
  V rate_square;   ///< dL/d‖D̂‖²
};
/// S: dL/dτ s in the frame U, symmetric; of_rate: S : D̂; o: the network's outputs.
template <class V>
UNIPHY_INLINE CoefficientGradients<V> coefficient_gradients(
    const StressState<V>& s, const Coefficients<V>& c, const Measures<V>& m, const Mat3<V>& S,
    const V& of_rate, const V (&o)[kStressOutputs], const V& inv_e) {
  using T = ScalarOf<V>;
  const V zero(T(0)), half(T(0.5)), third(T(1.0 / 3));
  CoefficientGradients<V> g;
  const V sum_S = S(0, 0) + S(1, 1) + S(2, 2), a1 = c.a1.value * inv_e, a2 = c.a2.value * inv_e;
  const V left_out = c.omega * sum_S * third;
  V g_a1 = zero, g_a2 = zero, g_n1 = zero, g_n2 = zero, of_x = zero;
  for (int i = 0; i < 3; ++i) {
    const StrainMeasure<V>&first = m.first[i], &second = m.second[i];
    const V of_stress = S(i, i) - left_out;
    g_a1 = lane_fma(of_stress, first.value * inv_e, g_a1);
    g_a2 = lane_fma(of_stress, second.value * inv_e, g_a2);
    g_n1 = lane_fma(of_stress, first.per_gamma + first.per_delta, g_n1);
    g_n2 = lane_fma(of_stress, second.per_gamma + second.per_delta, g_n2);
    g.strain[i] = of_stress * lane_fma(a1, first.slope, a2 * second.slope);
    of_x = of_x + g.strain[i];
  }
  const V g_k = sum_S * m.volume.value * inv_e, g_volume = sum_S * c.k.value * inv_e;
  const V rate_pressure = sum_S * s.rate_trace * third, of_power = of_rate * c.b1.value;
  const V g_b = lane_fma(rate_pressure, V(T(1)) - c.beta, of_rate);
  const V g_base = of_power * c.nu * m.power / m.base;
  g.a0 = sum_S;
  g.volume = g_volume * m.volume.slope;
  g.rate_square = g_base * c.kappa2;

  g.output[kBulk] = g_k * c.k.slope;
  g.output[kPressure] = sum_S;
  g.output[kShear] = g_a1 * c.a1.slope;
  g.output[kSecondShear] = g_a2 * c.a2.slope;
  g.output[kViscosity] = g_b * c.b.slope;
  g.output[kShearExponent] = bounded_gradient(o[kShearExponent], kExponentLimit, g_n1 * a1 * half);
  g.output[kSecondExponent] =
      bounded_gradient(o[kSecondExponent], kExponentLimit, g_n2 * a2 * half);
  g.output[kVolumeGamma] =
      bounded_gradient(o[kVolumeGamma], kExponentLimit, g_volume * m.volume.per_gamma);
  g.output[kVolumeDelta] =
      bounded_gradient(o[kVolumeDelta], kExponentLimit, g_volume * m.volume.per_delta);
  g.output[kIsochoricShare] = bounded_gradient(o[kIsochoricShare], kExponentLimit,
                                               -lane_fma(of_x * s.h.trace, third, m.mean * sum_S));
  g.output[kRateViscosity] = of_rate * m.power * c.b1.slope;
  const V squares = c.kappa2 * s.rate_square;
  g.output[kRateScale] =
      bounded_gradient(o[kRateScale], kRateScaleLimit, (g_base + g_base) * squares);
  g.output[kRateExponent] =
      bounded_gradient(o[kRateExponent], kRateExponentLimit, of_power * m.power * m.log_base);
  g.output[kBulkRateShare] = -rate_pressure * c.b.value;

  const V of_measures = g_k * c.k.value + g_a1 * c.a1.value + g_a2 * c.a2.value;  // all go as 1/e
  g.log_s = of_measures + sum_S * c.a0 + of_rate * m.viscosity + rate_pressure * bulk_viscosity(c);
  g.log_e = -of_measures;
  return g;
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
