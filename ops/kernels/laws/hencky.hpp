#pragma once

#include "ops/kernels/laws/material.hpp"
#include "ops/kernels/spectral/spectral.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// A strain state seen by the stress: singular values of F and their clamped logarithms.
/// slope and divided (see HenckyStrain) are needed by the adjoint only.
template <class V>
struct StressState {
  Vec3<V> sigma;
  Vec3<V> eps;
  V trace;
  Vec3<V> slope;
  Vec3<V> divided;
};

/// St. Venant–Kirchhoff law in the Hencky strain: τ = U (2μ ε + λ tr(ε) 1) Uᵀ, ε = log max(Σ,
/// 0.05); μ, λ in Pa. G. Klár et al., Drucker–Prager elastoplasticity for sand animation, SIGGRAPH
/// 2016, section 6.1.
template <class V>
UNIPHY_INLINE Mat3<V> hencky_stress(const Mat3<V>& U, const Vec3<V>& eps, const V& trace,
                                    const Material<V>& m) {
  const V two_mu = m.mu + m.mu, pressure = m.lambda * trace;
  Vec3<V> t;
  for (int i = 0; i < 3; ++i) t[i] = lane_fma(two_mu, eps[i], pressure);
  return compose(U, t, U);
}

/// dL/dF in the frame (U, V) from S = Uᵀ sym(dL/dτ) U; dL/dμ and dL/dλ accumulate.
template <class V>
UNIPHY_INLINE Mat3<V> hencky_adjoint(const StressState<V>& state, const Mat3<V>& S,
                                     const Material<V>& m, MaterialGradient<V>& g) {
  using T = ScalarOf<V>;
  const V two_mu = m.mu + m.mu, trace_S = trace(S), of_trace = m.lambda * trace_S;
  Mat3<V> B = zero3<V>();
  Vec3<V> divided;
  V of_mu(T(0));
  for (int i = 0; i < 3; ++i) {
    B(i, i) = lane_fma(two_mu, S(i, i), of_trace) * state.slope[i];
    of_mu = lane_fma(S(i, i), state.eps[i], of_mu);
    divided[i] = two_mu * state.divided[i];
  }
  add_symmetric_adjoint(state.sigma, divided, S, B);
  g.mu = g.mu + of_mu + of_mu;
  g.lambda = g.lambda + state.trace * trace_S;
  return B;
}

/// The stress as a function of F, for callers that have no singular values at hand.
struct Hencky {
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                      const Material<V>& m) {
    const Svd3<V> s = svd3(F);
    const HenckyStrain<V> h = hencky_strain(s.sigma, false);
    return hencky_stress(s.U, h.eps, h.trace, m);
  }
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress_adjoint(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                              const Material<V>& m, const Mat3<V>& G,
                                              Mat3<V>& /*grad_C*/, MaterialGradient<V>& g) {
    const Svd3<V> s = svd3(F);
    const HenckyStrain<V> h = hencky_strain(s.sigma, true);
    const StressState<V> state{s.sigma, h.eps, h.trace, h.slope, h.divided};
    const Mat3<V> S = mul(tmul(s.U, sym(G)), s.U);
    return mult(mul(s.U, hencky_adjoint(state, S, m, g)), s.V_);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
