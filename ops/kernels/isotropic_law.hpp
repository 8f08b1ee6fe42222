#pragma once

#include <limits>

#include "ops/kernels/learned_law_table.hpp"
#include "ops/kernels/mlp.hpp"
#include "ops/kernels/spectral.hpp"

// The isotropic form of the learned law: networks that see invariants and answer with the caps of a
// return mapping and the coefficients of a tensor basis.
//
// With ε = log Σ, t = tr ε, ε̂ its deviator, w = ε̂/e with the strain scale e of z, and the smooth
// invariants q ≈ ‖w‖, ℓ ≈ Σ wᵢ³/‖w‖² and n ≈ ‖D̂‖ (StrainInvariants):
//   projection  (c₀, c₂, m, κ) = g_φ(t/e, q, ℓ, z);  c₁ = c₀ + sinh(m) t/e,
//               ‖ε̂‖' = ‖ε̂‖ − r max(‖ε̂‖ − e max(c₁, 0), 0),  r = 1/(1 + exp(−κ)/b̄),  b̄ = tr(Σ²)/3,
//               t' = min(t, e c₂),  log Σ' = ‖ε̂‖' ε̂/‖ε̂‖ + t'/3;  F_proj = F bit for bit below
//               both caps, and exp(t'/3) I where c₁ < −½ and t is below its cap
//   stress      (k, a₀, a₁, a₂, b) = f_θ(t'/e, q, ℓ, tr D, n, x, z) of the projected F,
//               D = sym(C) t₀,  x = (w:D̂)/(1 + n q)
//               τ = s U [(k t'/e + a₀ − a₀(rest)) I + a₁ w + a₂ dev(w²)/(1 + q) + b D] Uᵀ
//
// The caps are what makes the laws easy: von Mises is a constant c₀; Drucker–Prager a constant m
// with c₂ = 0 (its apex included: c₁ < 0 where t > 0; the slope spans decades with λ/μ, hence the
// sinh); a viscoplastic law returns by the share r = 1/(1 + η/(2μ b̄ Δt)) of the way, a constant κ
// (J. C. Simo, C. Miehe, CMAME 98, 1992, for b̄); a fluid is c₁ < 0, an elastic body has both caps
// out of reach. A fluid's F forgets its shape, and with it its orientation: only F Fᵀ enters the
// stress and the next F Fᵀ, so that dropping the rotation moves nothing. Likewise k, a₁ and b are
// constants for a StVK–Hencky solid and for a viscous
// stress. c₂ has min(c₂(rest), 0) and a₀ its own answer at F = I, C = 0 taken off, so that
// nothing yields or moves at rest, whatever the training left. Both maps are exactly
// frame-indifferent. The adjoint goes by divided differences (spectral.hpp).

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
  const V root = lane_sqrt(fma(d, d, dot(s.w, s.w)));
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

/// The caps of one vector of particles, in units of e, and what their adjoint needs.
template <class V>
struct Caps {
  V c1, c2;
  V slope;        ///< sinh m = dc₁/d(t/e)
  V per_m;        ///< dc₁/dm
  V share;        ///< r
  V mean_square;  ///< b̄
};
/// `c`, `features`: the planes of a tile from lane l on, outputs and inputs of the projection.
template <class V, class T>
UNIPHY_INLINE Caps<V> caps(const LearnedLaw<T>& law, const T* c, const T* features,
                           const HenckyStrain<V>& h) {
  const V one = V(T(1)), half = V(T(0.5)), limit = V(T(kSlopeLimit));
  Caps<V> r;
  const V t = V::load_aligned(features), m = V::load_aligned(c + 2 * kTile);
  const V up = lane_exp(lane_max(lane_min(m, limit), -limit)), down = one / up;
  r.slope = half * (up - down);
  r.per_m = select<V>(lane_abs(m) < limit, half * (up + down) * t, V(T(0)));
  r.c1 = fma(r.slope, t, V::load_aligned(c));
  r.c2 = V::load_aligned(c + kTile) - V(law.rest_cap);
  r.mean_square = dot(h.stretch, h.stretch) * V(T(1.0 / 3));
  // Half the range of exp, so that neither it nor its square overflows in float.
  const V rate = lane_max(lane_min(V::load_aligned(c + 3 * kTile), V(T(40))), V(T(-40)));
  r.share = one / (one + lane_exp(-rate) / r.mean_square);
  return r;
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
  const V cut = select<V>(g.fluid, zero, fma(g.cap.share, g.ratio - one, one));
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

/// The coefficients of the tensor basis.
template <class V>
struct Coefficients {
  V k, a0, a1, a2, b;
};

/// The stress in units of s.
template <class V>
UNIPHY_INLINE Mat3<V> basis_stress(const StressState<V>& s, const Mat3<V>& U,
                                   const Coefficients<V>& c) {
  using T = ScalarOf<V>;
  const V pressure = fma(c.k, s.volumetric, fma(c.b * s.rate_trace, V(T(1.0 / 3)), c.a0));
  Vec3<V> d;
  for (int i = 0; i < 3; ++i) d[i] = fma(c.a1, s.invariants.w[i], fma(c.a2, s.second[i], pressure));
  return compose(U, d, U) + s.rate * c.b;
}

}  // namespace isotropic_detail

/// Scratch numbers of isotropic_evaluate and isotropic_adjoint for one tile.
template <class T>
std::ptrdiff_t isotropic_scratch(const LearnedLaw<T>& law) {
  return law.projection.tape_scratch() + law.stress.tape_scratch() + kTile * 72;
}

/// The forward tile: spectral factors and gate inputs are left in `tile` for the adjoint.
template <class T>
struct IsotropicTile {
  T *projection_in, *stress_in, *projection_tape, *stress_tape;
  T *U, *sigma, *V, *grad_projection, *grad_invariants, *grad_direct, *grad_stress;
  T *grad_features, *frame;
  explicit IsotropicTile(const LearnedLaw<T>& law, T* scratch) {
    T* at = scratch;
    const auto take = [&at](std::ptrdiff_t n) {
      T* r = at;
      at += n;
      return r;
    };
    U = take(9 * kTile);
    sigma = take(3 * kTile);
    V = take(9 * kTile);
    projection_in = take(4 * kTile);
    stress_in = take(8 * kTile);
    grad_projection = take(4 * kTile);
    grad_invariants = take(4 * kTile);
    grad_direct = take(kTile);
    grad_stress = take(8 * kTile);
    grad_features = take(8 * kTile);
    frame = take(9 * kTile);
    projection_tape = take(law.projection.tape_scratch());
    stress_tape = take(law.stress.tape_scratch());
  }
};

template <class V, class T>
UNIPHY_INLINE void store_plane(T* plane, std::ptrdiff_t l, const V& value) {
  value.store_aligned(plane + l);
}
template <class V, class T>
UNIPHY_INLINE Mat3<V> load_plane3(const T* plane, std::ptrdiff_t l) {
  Mat3<V> m;
  for (int k = 0; k < 9; ++k) m.e[k] = V::load_aligned(plane + k * kTile + l);
  return m;
}

/// One tile of `count` ≤ kTile particles. `keep` fills what isotropic_adjoint reads. Returns the
/// two networks' outputs through `h` and `a`.
template <bool keep, class T>
inline void isotropic_tile_forward(const LearnedLaw<T>& law, std::ptrdiff_t count,
                                   View<const T> F_trial, View<const T> C,
                                   const IsotropicTile<T>& tile, const T*& h, const T*& a) {
  using V = Lanes<T>;
  using namespace isotropic_detail;
  constexpr int w = width_of<V>;
  const T e = law.strain_scale;
  const V inv_e(T(1) / e);
  for (std::ptrdiff_t l = 0; l < kTile; l += w) {
    const Svd3<V> s = svd3(load_mat3<V, T>(F_trial, l, count - l, true));
    const HenckyStrain<V> strain = hencky_strain(s.sigma, false);
    for (int k = 0; k < 9; ++k) store_plane(tile.U + k * kTile, l, s.U.e[k]);
    for (int k = 0; k < 9; ++k) store_plane(tile.V + k * kTile, l, s.V_.e[k]);
    for (int k = 0; k < 3; ++k) store_plane(tile.sigma + k * kTile, l, s.sigma[k]);
    store_plane(tile.projection_in, l, strain.trace * inv_e);
    const StrainInvariants<V> invariants = strain_invariants(strain, inv_e);
    store_plane(tile.projection_in + kTile, l, invariants.q);
    store_plane(tile.projection_in + 2 * kTile, l, invariants.cubic);
  }
  h = keep ? mlp_forward_tape(law.projection, tile.projection_in, tile.projection_tape)
           : mlp_forward(law.projection, tile.projection_in, tile.projection_tape);
  for (std::ptrdiff_t l = 0; l < kTile; l += w) {
    Vec3<V> sigma;
    for (int k = 0; k < 3; ++k) sigma[k] = V::load_aligned(tile.sigma + k * kTile + l);
    const Mat3<V> U = load_plane3<V>(tile.U, l);
    const Gate<V> g = gate<V, T>(law, hencky_strain(sigma, false), h + l, tile.projection_in + l);
    const StressState<V> s = stress_state<V, T>(U, projected_sigma<V, T>(g, sigma),
                                                load_mat3<V, T>(C, l, count - l, false), e, false);
    store_plane(tile.stress_in, l, s.volumetric);
    store_plane(tile.stress_in + kTile, l, s.invariants.q);
    store_plane(tile.stress_in + 2 * kTile, l, s.invariants.cubic);
    store_plane(tile.stress_in + 3 * kTile, l, s.rate_trace);
    store_plane(tile.stress_in + 4 * kTile, l, s.rate_norm);
    store_plane(tile.stress_in + 5 * kTile, l, s.x);
  }
  a = keep ? mlp_forward_tape(law.stress, tile.stress_in, tile.stress_tape)
           : mlp_forward(law.stress, tile.stress_in, tile.stress_tape);
}

template <class V, class T>
UNIPHY_INLINE isotropic_detail::Coefficients<V> load_coefficients(const LearnedLaw<T>& law,
                                                                  const T* a, std::ptrdiff_t l) {
  return {V::load_aligned(a + l), V::load_aligned(a + kTile + l) - V(law.rest_pressure),
          V::load_aligned(a + 2 * kTile + l), V::load_aligned(a + 3 * kTile + l),
          V::load_aligned(a + 4 * kTile + l)};
}

/// F_trial, C → F_proj, tau for count ≤ kTile particles.
template <class T>
inline void isotropic_evaluate(const LearnedLaw<T>& law, std::ptrdiff_t count,
                               View<const T> F_trial, View<const T> C, View<T> F_proj, View<T> tau,
                               T* scratch) {
  using V = Lanes<T>;
  using namespace isotropic_detail;
  const IsotropicTile<T> tile(law, scratch);
  const T *h, *a;
  isotropic_tile_forward<false>(law, count, F_trial, C, tile, h, a);
  const T e = law.strain_scale;
  for (std::ptrdiff_t l = 0; l < count; l += width_of<V>) {
    const Mat3<V> F = load_mat3<V, T>(F_trial, l, count - l, true);
    Vec3<V> sigma;
    for (int k = 0; k < 3; ++k) sigma[k] = V::load_aligned(tile.sigma + k * kTile + l);
    const Mat3<V> U = load_plane3<V>(tile.U, l), Vm = load_plane3<V>(tile.V, l);
    const Gate<V> g = gate<V, T>(law, hencky_strain(sigma, false), h + l, tile.projection_in + l);
    const StressState<V> s = stress_state<V, T>(U, projected_sigma<V, T>(g, sigma),
                                                load_mat3<V, T>(C, l, count - l, false), e, false);
    if (F_proj) store_mat3<V, T>(F_proj, l, count - l, projected_F(g, U, Vm, F));
    if (tau)
      store_mat3<V, T>(tau, l, count - l,
                       basis_stress(s, U, load_coefficients<V>(law, a, l)) * V(law.stress_scale));
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
