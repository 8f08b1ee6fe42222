#pragma once

#include <cmath>
#include <limits>

#include "ops/kernels/laws/power_flow.hpp"
#include "ops/kernels/learned/learned_law_table.hpp"
#include "ops/kernels/learned/power_law.hpp"
#include "ops/kernels/spectral/spectral.hpp"

// The projection of the isotropic form (formulas: isotropic_law.hpp): the invariants that its
// network sees, and the caps of a return mapping that the network answers with.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Invariants of w = ε̂/e. The plain norm has a kink at w = 0, where every simulation starts; the
/// shifted root is smooth and equals the norm up to kInvariantSmoothing away from it.
template <class V>
struct StrainInvariants {
  Vec3<V> w;
  V q;              ///< sqrt(‖w‖² + d²) − d
  V cubic;          ///< ℓ = Σ wᵢ³/(‖w‖² + d²)
  V inverse_root;   ///< 1/sqrt(‖w‖² + d²); dq/dw = w inverse_root
  Vec3<V> d_cubic;  ///< dℓ/dw
};
template <class V>
UNIPHY_INLINE StrainInvariants<V> strain_invariants(const HenckyStrain<V>& h, const V& inv_e) {
  using T = ScalarOf<V>;
  const V d = V(T(kInvariantSmoothing));
  StrainInvariants<V> s;
  for (int i = 0; i < 3; ++i) s.w[i] = h.deviator[i] * inv_e;
  const V root = lane_sqrt(lane_fma(d, d, dot(s.w, s.w)));
  s.inverse_root = V(T(1)) / root;
  s.q = root - d;
  const V inv2 = s.inverse_root * s.inverse_root;
  s.cubic = (s.w[0] * s.w[0] * s.w[0] + s.w[1] * s.w[1] * s.w[1] + s.w[2] * s.w[2] * s.w[2]) * inv2;
  for (int i = 0; i < 3; ++i)
    s.d_cubic[i] = (V(T(3)) * s.w[i] * s.w[i] - V(T(2)) * s.cubic * s.w[i]) * inv2;
  return s;
}

namespace isotropic_detail {

/// 1/x, or 0 where x is 0: the direction ε̂/‖ε̂‖ vanishes with its norm.
template <class V>
UNIPHY_INLINE V safe_inverse(const V& x) {
  using T = ScalarOf<V>;
  const auto positive = x > V(std::numeric_limits<T>::min());
  return select<V>(positive, V(T(1)) / select<V>(positive, x, V(T(1))), V(T(0)));
}

/// An output that is bounded, and its derivative.
template <class V>
UNIPHY_INLINE V bounded(const V& output, double bound) {
  using T = ScalarOf<V>;
  return lane_max(lane_min(output, V(T(bound))), V(T(-bound)));
}
template <class V>
UNIPHY_INLINE V bounded_gradient(const V& output, double bound, const V& gradient) {
  using T = ScalarOf<V>;
  return select<V>(lane_abs(output) < V(T(bound)), gradient, V(T(0)));
}

/// A coefficient that spans decades: sinh of a network's output, and its derivative.
template <class V>
struct SinhOf {
  V value, slope;
};
template <class V>
UNIPHY_INLINE SinhOf<V> sinh_of(const V& output) {
  using T = ScalarOf<V>;
  const V limit = V(T(kSinhLimit)), half(T(0.5));
  const V up = lane_exp(lane_max(lane_min(output, limit), -limit)), down = V(T(1)) / up;
  return {half * (up - down), select<V>(lane_abs(output) < limit, half * (up + down), V(T(0)))};
}

/// The caps of one vector of particles, in units of e, and what their adjoint needs.
template <class V>
struct Caps {
  V c1, c2;
  V slope;          ///< sinh m = dc₁/d(t/e)
  V per_m;          ///< dc₁/dm
  V viscosity;      ///< v
  V per_viscosity;  ///< dv/dη̃
  V factor;         ///< b̄ Δt/Δt₀, by which the rate of flow of v is to be taken
  V exponent;       ///< p
  V per_exponent;   ///< dp/dp̃
  V mean_square;    ///< b̄
};
/// What the projection network answers, as far as it does not depend on the state.
template <class V>
struct CapOutputs {
  V c0, c2;
  SinhOf<V> slope, viscosity;  ///< of m and η̃
  V exponent, per_exponent;    ///< p and dp/dp̃
  V time;                      ///< Δt/Δt₀
};
/// `o`: the network's outputs; flow_time: Δt₀/Δt.
template <class V>
UNIPHY_INLINE CapOutputs<V> cap_outputs(const V (&o)[kCapOutputs], const V& flow_time) {
  using T = ScalarOf<V>;
  const V one(T(1)), limit = V(T(kFlowPowerLimit));
  // log p = limit tanh(p̃/limit): bounded, and never without a slope.
  const V twice = lane_exp(bounded(o[kFlowExponent], kSinhLimit) * V(T(2 / kFlowPowerLimit)));
  const V tanh = (twice - one) / (twice + one), exponent = lane_exp(limit * tanh);
  return {o[kCap],
          o[kTraceCap],
          sinh_of(o[kCapSlope]),
          sinh_of(o[kCapViscosity]),
          exponent,
          exponent * (one - tanh * tanh),
          one / flow_time};
}
/// t: tr ε/e; `rest`: what c₂ has taken off.
template <class V>
UNIPHY_INLINE Caps<V> caps(const CapOutputs<V>& c, const V& rest, const V& t,
                           const Vec3<V>& stretch) {
  using T = ScalarOf<V>;
  Caps<V> r;
  r.slope = c.slope.value;
  r.per_m = c.slope.slope * t;
  r.c1 = lane_fma(r.slope, t, c.c0);
  r.c2 = c.c2 - rest;
  r.mean_square = dot(stretch, stretch) * V(T(1.0 / 3));
  r.viscosity = c.viscosity.value;
  r.per_viscosity = c.viscosity.slope;
  r.factor = r.mean_square * c.time;
  // Without a yield surface the rate is linear: a power of ‖ε̂‖ has no slope at rest.
  const V one = V(T(1)), zero = V(T(0));
  r.exponent = select<V>(r.c1 > zero, c.exponent, one);
  r.per_exponent = select<V>(r.c1 > zero, c.per_exponent, zero);
  return r;
}

/// The share that is taken off at a time where p = 1, and its derivative by v.
template <class V>
struct ReturnShare {
  V value, per_viscosity;
};
template <class V>
UNIPHY_INLINE ReturnShare<V> return_share(const Caps<V>& c) {
  using T = ScalarOf<V>;
  const V least = V(T(kLeastViscosity)), v = c.viscosity / c.factor;
  const V share = V(T(1)) / (V(T(1)) + lane_max(v, least));
  return {share, select<V>(v > least, -share * share / c.factor, V(T(0)))};
}

inline const double kLogFlowExcess = std::log(kFlowExcess);

/// What stays of an excess x over the cap, both in units of e: the y with y + B yᵖ = x,
/// B = f ((1 + v)/x₀)^{p−1}/vᵖ, so that x₀ = kFlowExcess keeps the share v/(1 + v) at f = 1
/// whatever the power. x v/(f + v) where v ≤ 0 or x ≤ 0, v/f being bounded from below.
template <class V>
struct KeptExcess {
  V value, per_excess, per_viscosity, per_log_factor, per_exponent;
};
template <class V>
UNIPHY_INLINE KeptExcess<V> kept_excess(const V& x, const Caps<V>& c) {
  using T = ScalarOf<V>;
  const V one(T(1)), zero(T(0)), v = c.viscosity, p = c.exponent;
  const ReturnShare<V> share = return_share(c);
  const V linear = one - share.value;
  KeptExcess<V> k;
  k.value = x * linear;
  k.per_excess = linear;
  k.per_viscosity = -x * share.per_viscosity;
  k.per_log_factor = x * share.per_viscosity * v;
  k.per_exponent = zero;
  const V tiny = V(std::numeric_limits<T>::min());
  const auto powered = v > tiny && x > tiny && p != one;
  if (!any<V>(powered)) return k;
  const V excess = select<V>(powered, x, one), flow = select<V>(powered, v, one);
  const V log_excess = lane_log(excess), log_flow = lane_log(flow);
  const V log_rest = lane_log1p(flow) - V(T(kLogFlowExcess));
  const V log_B = lane_fma(p - one, log_rest, lane_log(c.factor)) - p * log_flow;
  const PowerFlow<V> f = power_flow(p, lane_fma(p - one, log_excess, log_B));
  const V kept = excess * f.share, per_log_B = (kept - excess) * f.slope;
  k.value = select<V>(powered, kept, k.value);
  k.per_excess = select<V>(powered, f.slope, k.per_excess);
  k.per_viscosity =
      select<V>(powered, per_log_B * ((p - one) / (one + flow) - p / flow), k.per_viscosity);
  k.per_log_factor = select<V>(powered, per_log_B, k.per_log_factor);
  k.per_exponent =
      select<V>(powered, per_log_B * (log_excess + f.log_share + log_rest - log_flow), zero);
  return k;
}

/// `c`, `features`: the planes of a tile from lane l on, outputs and inputs of the projection.
template <class V, class T>
UNIPHY_INLINE Caps<V> caps(const LearnedLaw<T>& law, T flow_time, const T* c, const T* features,
                           const HenckyStrain<V>& h) {
  V o[kCapOutputs];
  for (int k = 0; k < kCapOutputs; ++k) o[k] = V::load_aligned(c + k * kTile);
  return caps(cap_outputs<V>(o, V(flow_time)), V(law.rest_cap), V::load_aligned(features),
              h.stretch);
}

/// The gate's answer for one vector of particles.
template <class V>
struct Gate {
  Caps<V> cap;
  MaskOf<V> cuts_q;  ///< the deviator is cut
  MaskOf<V> caps_q;  ///< towards e c₁ > 0, not towards 0
  MaskOf<V> caps_t;
  MaskOf<V> fluid;
  MaskOf<V> yields;
  KeptExcess<V> kept;
  V scale;  ///< ‖ε̂‖'/‖ε̂‖ where cut
  LogMap<V> map;
};
template <class V, class T>
UNIPHY_INLINE Gate<V> gate(const LearnedLaw<T>& law, T flow_time, const HenckyStrain<V>& h,
                           const T* c, const T* features) {
  const V zero(T(0)), one(T(1)), e(law.strain_scale);
  Gate<V> g;
  g.cap = caps<V>(law, flow_time, c, features, h);
  const V least_q = lane_max(g.cap.c1, zero), cap_q = e * least_q, cap_t = e * g.cap.c2;
  // c₁ ≤ 0 yields even at ‖ε̂‖ = 0, where only the derivative can tell.
  g.cuts_q = h.norm > cap_q || g.cap.c1 <= zero;
  g.caps_q = g.cuts_q && g.cap.c1 > zero;
  g.caps_t = h.trace > cap_t;
  g.fluid = g.cap.c1 < V(T(kFluidCap)) && !g.caps_t;
  g.yields = g.cuts_q || g.caps_t;
  const auto flows = g.cuts_q && !g.fluid;
  const V excess = select<V>(flows, lane_fma(h.norm, one / e, -least_q), zero);
  g.kept = kept_excess<V>(excess, g.cap);
  const V inverse = safe_inverse(h.norm);
  g.scale =
      select<V>(h.norm * inverse > zero, e * (least_q + g.kept.value) * inverse, g.kept.per_excess);
  const V cut = select<V>(g.fluid, zero, g.scale);
  g.map = log_map(h, select<V>(g.cuts_q, cut, one), select<V>(g.caps_t, cap_t, h.trace));
  return g;
}

template <class V, class T>
UNIPHY_INLINE Vec3<V> projected_sigma(const Gate<V>& g, const Vec3<V>& sigma) {
  Vec3<V> r;
  for (int i = 0; i < 3; ++i) r[i] = select<V>(g.yields, g.map.sigma[i], sigma[i]);
  return r;
}

template <class V>
UNIPHY_INLINE Mat3<V> projected_F(const Gate<V>& g, const Mat3<V>& U, const Mat3<V>& Vm,
                                  const Mat3<V>& F) {
  Mat3<V> r = select3(g.yields, compose(U, g.map.sigma, Vm), F);
  const V zero(ScalarOf<V>(0));
  for (int k = 0; k < 9; ++k)
    r.e[k] = select<V>(g.fluid, k % 4 == 0 ? g.map.sigma[0] : zero, r.e[k]);
  return r;
}

}  // namespace isotropic_detail
}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
