#pragma once

#include "ops/kernels/laws/return_map.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Drucker–Prager return mapping of sand without cohesion. With t = tr ε, q = ‖ε̂‖,
/// α = √(2/3) · 2 sin θ/(3 − sin θ) and β = α (3λ + 2μ)/(2μ), δγ = q + β t:
/// t > 0 (tension): U Vᵀ. Else δγ ≤ 0: F. Else U exp(ε − δγ ε̂/q) Vᵀ, i.e. ‖ε̂‖ becomes −β t.
/// θ in rad; μ, λ in Pa. Cohesive sand has t − c in place of t, c a strain: its apex, where it
/// tears, is exp(c/3) U Vᵀ.
/// G. Klár et al., Drucker–Prager elastoplasticity for sand animation, SIGGRAPH 2016, section 6.3.
template <bool kCohesive>
struct DruckerPragerCone {
  static constexpr double kRoot = 0.81649658092772603273;  ///< √(2/3)

  template <class V>
  static UNIPHY_INLINE V alpha(const Material<V>& m) {
    using T = ScalarOf<V>;
    return V(T(2 * kRoot)) * m.sin_theta / (V(T(3)) - m.sin_theta);
  }

  template <class V>
  static UNIPHY_INLINE V apex(const Material<V>& m) {
    return kCohesive ? m.cohesion : V(ScalarOf<V>(0));
  }

  template <class V>
  static UNIPHY_INLINE ReturnMap<V> map(const HenckyStrain<V>& h, const Material<V>& m) {
    using T = ScalarOf<V>;
    const V zero(T(0)), one(T(1)), three(T(3)), two_mu = m.mu + m.mu;
    const V beta = alpha(m) * lane_fma(three, m.lambda, two_mu) / two_mu;
    const V t = h.trace - apex(m);
    const MaskOf<V> tension = t > zero;
    const MaskOf<V> slides = lane_fma(beta, t, h.norm) > zero;
    ReturnMap<V> r;
    r.yields = tension || slides;
    const V norm = select<V>(h.norm > zero, h.norm, one);
    r.scale = select<V>(tension, zero, select<V>(slides, -beta * t / norm, one));
    r.trace = select<V>(tension, apex(m), h.trace);
    return r;
  }

  template <class V>
  static UNIPHY_INLINE void adjoint(const HenckyStrain<V>& h, const Material<V>& m,
                                    const ReturnMap<V>& r, const V& grad_scale, const V& grad_trace,
                                    StrainGradient<V>& strain, MaterialGradient<V>& g) {
    using T = ScalarOf<V>;
    const V zero(T(0)), one(T(1)), three(T(3)), two_mu = m.mu + m.mu;
    const V a = alpha(m), stiffness = lane_fma(three, m.lambda, two_mu) / two_mu,
            beta = a * stiffness;
    // Nothing depends on the strain at the tip of the cone.
    const V t = h.trace - apex(m);
    const MaskOf<V> cone = r.yields && !(t > zero);
    const V per_q = select<V>(cone, grad_scale / select<V>(h.norm > zero, h.norm, one), zero);
    strain.add_norm(h, -per_q * r.scale);
    strain.trace = strain.trace + select<V>(cone, grad_trace - per_q * beta, zero);
    if (kCohesive)
      g.cohesion =
          g.cohesion + select<V>(cone, per_q * beta, select<V>(r.yields, grad_trace, zero));
    const V of_beta = -per_q * t;
    const V gap = three - m.sin_theta;
    const V alpha_slope = V(T(6 * kRoot)) * m.cos_theta / (gap * gap);
    g.theta = g.theta + of_beta * stiffness * alpha_slope;
    g.lambda = g.lambda + of_beta * a * three / two_mu;
    g.mu = g.mu - of_beta * a * three * m.lambda / (two_mu * m.mu);
  }
};
using DruckerPrager = DruckerPragerCone<false>;
using CohesiveDruckerPrager = DruckerPragerCone<true>;

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
