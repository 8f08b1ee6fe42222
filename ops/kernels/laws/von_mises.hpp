#pragma once

#include "ops/kernels/laws/return_map.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Von Mises return mapping of plasticine. With q = ‖ε̂‖ and k = τ_Y/(2μ), δγ = q − k:
/// δγ ≤ 0: F. Else U exp(ε − δγ ε̂/q) Vᵀ, i.e. ε̂ shrinks by k/q at constant trace. (k carries no
/// √(2/3): τ_Y bounds the norm of the deviatoric stress itself.) τ_Y, μ in Pa.
/// J. C. Simo, T. J. R. Hughes, Computational Inelasticity, section 3.3.
struct VonMises {
  template <class V>
  static UNIPHY_INLINE ReturnMap<V> map(const HenckyStrain<V>& h, const Material<V>& m) {
    const V one(ScalarOf<V>(1)), k = m.tau_y / (m.mu + m.mu);
    ReturnMap<V> r;
    r.yields = h.norm > k;
    r.scale = select<V>(r.yields, k / select<V>(r.yields, h.norm, one), one);
    r.trace = h.trace;
    return r;
  }

  /// Given dL/dscale and dL/dtrace, which are 0 on lanes that do not yield.
  template <class V>
  static UNIPHY_INLINE void adjoint(const HenckyStrain<V>& h, const Material<V>& m,
                                    const ReturnMap<V>& r, const V& grad_scale, const V& grad_trace,
                                    StrainGradient<V>& strain, MaterialGradient<V>& g) {
    const V one(ScalarOf<V>(1)), two_mu = m.mu + m.mu;
    const V per_q = grad_scale / select<V>(r.yields, h.norm, one);
    const V of_k = per_q;  // dscale/dk = 1/q, dscale/dq = −scale/q
    strain.add_norm(h, -per_q * r.scale);
    strain.trace = strain.trace + grad_trace;
    g.tau_y = g.tau_y + of_k / two_mu;
    g.mu = g.mu - of_k * m.tau_y / (two_mu * m.mu);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
