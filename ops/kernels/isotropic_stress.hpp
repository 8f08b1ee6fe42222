#pragma once

#include "ops/kernels/isotropic_gate.hpp"
#include "ops/kernels/strain_measure.hpp"

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
template <class V, class T>
UNIPHY_INLINE StressState<V> stress_state(const Mat3<V>& U, const Vec3<V>& sigma, const Mat3<V>& C,
                                          T strain_scale, bool gradients) {
  const V one(T(1)), third(T(1.0 / 3)), inv_e(T(1) / strain_scale);
  StressState<V> s;
  s.h = hencky_strain(sigma, gradients);
  s.invariants = strain_invariants(s.h, inv_e);
  s.volumetric = s.h.trace * inv_e;
  s.rate = sym(C) * V(T(kTimeScale));
  s.rate_trace = trace(s.rate);
  for (int k = 0; k < 9; k += 4) s.rate.e[k] = s.rate.e[k] - s.rate_trace * third;
  const V d = V(T(kInvariantSmoothing));
  const V rate_root = lane_sqrt(fma(d, d, dot(s.rate, s.rate)));
  s.rate_norm = rate_root - d;
  s.inverse_rate_root = one / rate_root;
  s.rate_frame = tmul(U, mul(s.rate, U));
  const Vec3<V>& w = s.invariants.w;
  s.aligned = w[0] * s.rate_frame(0, 0) + w[1] * s.rate_frame(1, 1) + w[2] * s.rate_frame(2, 2);
  s.x = s.aligned / fma(s.rate_norm, s.invariants.q, one);
  s.spread = one / (one + s.invariants.q);
  Vec3<V> w2;
  for (int i = 0; i < 3; ++i) w2[i] = w[i] * w[i];
  const V mean = sum(w2) * third;
  for (int i = 0; i < 3; ++i) s.second[i] = (w2[i] - mean) * s.spread;
  return s;
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
/// `a`: the planes of the stress network's outputs from a lane on.
template <class V, class T>
UNIPHY_INLINE Coefficients<V> coefficients(const LearnedLaw<T>& law, const T* a) {
  const auto output = [a](int k) { return V::load_aligned(a + k * kTile); };
  return {sinh_of(output(0)),
          sinh_of(output(2)),
          sinh_of(output(4)),
          output(1) - V(law.rest_pressure),
          output(3),
          exponent_of(output(5)),
          exponent_of(output(6)),
          exponent_of(output(7))};
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

/// The stress in units of s.
template <class V>
UNIPHY_INLINE Mat3<V> basis_stress(const StressState<V>& s, const Mat3<V>& U,
                                   const Coefficients<V>& c, const V& inv_e) {
  using T = ScalarOf<V>;
  const Measures<V> m = measures(s, c);
  const V pressure =
      fma(c.k.value * inv_e, m.volume.value, fma(c.b.value * s.rate_trace, V(T(1.0 / 3)), c.a0));
  const V a1 = c.a1.value * inv_e;
  Vec3<V> d;
  for (int i = 0; i < 3; ++i) d[i] = fma(a1, m.strain[i].value, fma(c.a2, s.second[i], pressure));
  return compose(U, d, U) + s.rate * c.b.value;
}

}  // namespace isotropic_detail
}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
