#pragma once

#include "ops/kernels/laws/return_map.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Viscoplastic von Mises return mapping of the non-Newtonian material. With q = ‖ε̂‖,
/// k = τ_Y/(2μ), δγ = q − k, μ̂ = (μ/3) tr(Σ²) and s = 2μ ε̂:
/// δγ ≤ 0: F. Else ŝ = ‖s‖ − 2μ δγ/(1 + η/(2μ̂Δt)) and F becomes
/// U exp((ŝ/(2μ)) ε̂/q + tr(ε)/3) Vᵀ. Σ in μ̂ is clamped below at 0.05 like the strain.
/// In other words ε̂ shrinks by (k + r δγ)/q with r = η/(2μ̂Δt + η): r = 0 is von Mises exactly
/// and r = 1 the identity. τ_Y, μ in Pa, η in Pa s, Δt in s.
/// Y. Yue et al., Continuum foam: a material point method for shear-dependent flows, ACM TOG 2015.
struct Viscoplastic {
  /// m = 2μ̂Δt and r = η/(m + η), 0 where both vanish.
  template <class V>
  struct Rate {
    V m, r, inverse;
  };
  template <class V>
  static UNIPHY_INLINE Rate<V> rate(const HenckyStrain<V>& h, const Material<V>& m) {
    using T = ScalarOf<V>;
    Rate<V> rate;
    rate.m = V(T(2.0 / 3)) * m.mu * m.dt * dot(h.stretch, h.stretch);
    const V sum = rate.m + m.eta;
    const MaskOf<V> flows = sum > V(T(0));
    rate.inverse = select<V>(flows, V(T(1)) / select<V>(flows, sum, V(T(1))), V(T(0)));
    rate.r = m.eta * rate.inverse;
    return rate;
  }

  template <class V>
  static UNIPHY_INLINE ReturnMap<V> map(const HenckyStrain<V>& h, const Material<V>& m) {
    const V one(ScalarOf<V>(1)), k = m.tau_y / (m.mu + m.mu);
    ReturnMap<V> r;
    r.yields = h.norm > k;
    const V norm = lane_fma(rate(h, m).r, h.norm - k, k);
    r.scale = select<V>(r.yields, norm / select<V>(r.yields, h.norm, one), one);
    r.trace = h.trace;
    return r;
  }

  template <class V>
  static UNIPHY_INLINE void adjoint(const HenckyStrain<V>& h, const Material<V>& m,
                                    const ReturnMap<V>& r, const V& grad_scale, const V& grad_trace,
                                    StrainGradient<V>& strain, MaterialGradient<V>& g) {
    using T = ScalarOf<V>;
    const V one(T(1)), two_mu = m.mu + m.mu, k = m.tau_y / two_mu;
    const Rate<V> visc = rate(h, m);
    const V per_q = grad_scale / select<V>(r.yields, h.norm, one);
    strain.add_norm(h, per_q * (visc.r - r.scale));
    const V of_k = per_q * (one - visc.r);
    const V of_r = per_q * (h.norm - k);
    const V of_m = -of_r * visc.r * visc.inverse;
    g.eta = g.eta + of_r * visc.m * visc.inverse * visc.inverse;
    g.tau_y = g.tau_y + of_k / two_mu;
    g.mu = g.mu - of_k * k / m.mu + of_m * visc.m / m.mu;
    // dm/dε_i = (4/3) μ Δt Σ_i², split into deviator and trace.
    const V c = of_m * V(T(4.0 / 3)) * m.mu * m.dt;
    Vec3<V> of_eps;
    for (int i = 0; i < 3; ++i) {
      of_eps[i] = c * h.stretch[i] * h.stretch[i];
      strain.deviator[i] = strain.deviator[i] + of_eps[i];
    }
    strain.trace = strain.trace + grad_trace + sum(of_eps) * V(T(1.0 / 3));
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
