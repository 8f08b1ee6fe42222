#pragma once

#include <limits>

#include "ops/kernels/learned/learned_law_table.hpp"
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
  V slope;           ///< sinh m = dc₁/d(t/e)
  V per_m;           ///< dc₁/dm
  V share;           ///< r
  V per_viscosity;   ///< dr/dη̃
  V per_log_square;  ///< dr/d(log b̄)
  V mean_square;     ///< b̄
};
/// What the projection network answers, as far as it does not depend on the state.
template <class V>
struct CapOutputs {
  V c0, c2;
  SinhOf<V> slope, viscosity;  ///< of m and η̃
};
template <class V>
UNIPHY_INLINE CapOutputs<V> cap_outputs(const V& c0, const V& c2, const V& m, const V& eta) {
  return {c0, c2, sinh_of(m), sinh_of(eta)};
}
/// t: tr ε/e; `rest`: what c₂ has taken off.
template <class V>
UNIPHY_INLINE Caps<V> caps(const CapOutputs<V>& c, const V& rest, const V& t,
                           const Vec3<V>& stretch) {
  using T = ScalarOf<V>;
  const V zero = V(T(0));
  Caps<V> r;
  r.slope = c.slope.value;
  r.per_m = c.slope.slope * t;
  r.c1 = lane_fma(r.slope, t, c.c0);
  r.c2 = c.c2 - rest;
  r.mean_square = dot(stretch, stretch) * V(T(1.0 / 3));
  const V least = V(T(kLeastViscosity)) * r.mean_square;
  const auto free = c.viscosity.value > least;
  const V inverse = V(T(1)) / (r.mean_square + lane_max(c.viscosity.value, least));
  r.share = r.mean_square * inverse;
  const V slope = select<V>(free, r.share * inverse, zero);
  r.per_viscosity = -slope * c.viscosity.slope;
  r.per_log_square = slope * c.viscosity.value;
  return r;
}
/// `c`, `features`: the planes of a tile from lane l on, outputs and inputs of the projection.
template <class V, class T>
UNIPHY_INLINE Caps<V> caps(const LearnedLaw<T>& law, const T* c, const T* features,
                           const HenckyStrain<V>& h) {
  const auto output = [c](int k) { return V::load_aligned(c + k * kTile); };
  return caps(cap_outputs<V>(output(0), output(1), output(2), output(3)), V(law.rest_cap),
              V::load_aligned(features), h.stretch);
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
  V ratio;  ///< e max(c₁, 0)/‖ε̂‖
  LogMap<V> map;
};
template <class V, class T>
UNIPHY_INLINE Gate<V> gate(const LearnedLaw<T>& law, const HenckyStrain<V>& h, const T* c,
                           const T* features) {
  const V zero(T(0)), one(T(1)), e(law.strain_scale);
  Gate<V> g;
  g.cap = caps<V>(law, c, features, h);
  const V cap_q = e * lane_max(g.cap.c1, zero), cap_t = e * g.cap.c2;
  // c₁ ≤ 0 yields even at ‖ε̂‖ = 0, where only the derivative can tell.
  g.cuts_q = h.norm > cap_q || g.cap.c1 <= zero;
  g.caps_q = g.cuts_q && g.cap.c1 > zero;
  g.caps_t = h.trace > cap_t;
  g.fluid = g.cap.c1 < V(T(kFluidCap)) && !g.caps_t;
  g.yields = g.cuts_q || g.caps_t;
  g.ratio = select<V>(g.caps_q, cap_q * safe_inverse(h.norm), zero);
  const V cut = select<V>(g.fluid, zero, lane_fma(g.cap.share, g.ratio - one, one));
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
