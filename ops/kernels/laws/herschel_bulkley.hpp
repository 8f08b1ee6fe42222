#pragma once

#include "ops/kernels/laws/power_flow.hpp"
#include "ops/kernels/laws/return_map.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Herschel–Bulkley return mapping: a yield stress, and above it a rate of flow that is a power of
/// the excess. With q = ‖ε̂‖ and ‖s‖ = 2μ q, the norm after the step solves
///   ‖s‖ + 2μ Δt ((‖s‖ − τ_Y)/η)^{1/n} = ‖s_trial‖   where ‖s_trial‖ > τ_Y, else F.
/// τ_Y, μ in Pa, η in Pa sⁿ, Δt in s; n is the flow index (h in some texts).
/// Y. Yue et al., Continuum foam: a material point method for shear-dependent flows, ACM TOG 2015.
struct HerschelBulkley {
  /// The share x of the excess e = ‖s_trial‖ − τ_Y that stays: x + A x^p = 1 with p = 1/n and
  /// A = 2μ Δt e^{p−1} η^{−p}.
  template <class V>
  struct Flow {
    V excess, p, log_ratio;  ///< log_ratio = log(e/η)
    V x, log_x, slope;       ///< slope: dy/de of y = x e
  };
  template <class V>
  static UNIPHY_INLINE Flow<V> flow(const HenckyStrain<V>& h, const MaskOf<V>& yields,
                                    const Material<V>& m) {
    using T = ScalarOf<V>;
    const V one(T(1)), two_mu = m.mu + m.mu;
    Flow<V> f;
    f.excess = select<V>(yields, two_mu * h.norm - m.tau_y, one);
    f.p = one / m.n;
    f.log_ratio = lane_log(f.excess / m.eta);
    const V log_A = lane_log(two_mu * m.dt / f.excess) + f.p * f.log_ratio;
    const PowerFlow<V> flow = power_flow(f.p, log_A);
    f.x = flow.share;
    f.log_x = flow.log_share;
    f.slope = flow.slope;
    return f;
  }
  template <class V>
  static UNIPHY_INLINE ReturnMap<V> map(const HenckyStrain<V>& h, const Material<V>& m) {
    using T = ScalarOf<V>;
    const V one(T(1)), two_mu = m.mu + m.mu;
    ReturnMap<V> r;
    r.yields = h.norm * two_mu > m.tau_y;
    r.scale = one;
    r.trace = h.trace;
    if (!any<V>(r.yields)) return r;
    const Flow<V> f = flow(h, r.yields, m);
    const V norm = lane_fma(f.x, f.excess, m.tau_y) / two_mu;
    r.scale = select<V>(r.yields, norm / select<V>(r.yields, h.norm, one), one);
    return r;
  }

  /// y = x e keeps y + 2μ Δt (y/η)^p = e: dy = (de − (e − y)(dμ/μ − p dη/η + log(y/η) dp))/D with
  /// D = 1 + p (e − y)/y.
  template <class V>
  static UNIPHY_INLINE void adjoint(const HenckyStrain<V>& h, const Material<V>& m,
                                    const ReturnMap<V>& r, const V& grad_scale, const V& grad_trace,
                                    StrainGradient<V>& strain, MaterialGradient<V>& g) {
    using T = ScalarOf<V>;
    const V one(T(1)), two(T(2)), two_mu = m.mu + m.mu;
    strain.trace = strain.trace + grad_trace;
    if (!any<V>(r.yields)) return;
    const Flow<V> f = flow(h, r.yields, m);
    const V per_q = grad_scale / select<V>(r.yields, h.norm, one);  // by the norm after the step
    const V of_y = per_q / two_mu;
    const V of_e = of_y * f.slope;
    const V of_rate = -of_e * f.excess * (one - f.x);
    strain.add_norm(h, of_e * two_mu - per_q * r.scale);
    g.tau_y = g.tau_y + of_y - of_e;
    g.eta = g.eta - of_rate * f.p / m.eta;
    g.n = g.n - of_rate * (f.log_ratio + f.log_x) * f.p * f.p;
    // By μ: the norm divides by 2μ, the excess grows with it, the rate too.
    g.mu = g.mu - per_q * r.scale * h.norm / m.mu + two * of_e * h.norm + of_rate / m.mu;
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
