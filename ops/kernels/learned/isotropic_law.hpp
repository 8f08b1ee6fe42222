#pragma once

#include "ops/kernels/learned/isotropic_stress.hpp"
#include "ops/kernels/mlp/mlp.hpp"

// The isotropic form of the learned law: networks that see invariants and answer with the caps of a
// return mapping and the coefficients of a tensor basis.
//
// With ε = log Σ, t = tr ε, ε̂ its deviator, w = ε̂/e with the strain scale e of z, and the smooth
// invariants q ≈ ‖w‖ and ℓ ≈ Σ wᵢ³/‖w‖² (StrainInvariants):
//   projection  (c₀, c₂, m, η̃, p̃) = g_φ(t/e, q, ℓ, z);  c₁ = c₀ + sinh(m) t/e,  c = max(c₁, 0);
//               where ‖ε̂‖ > e c:  ‖ε̂‖' = e (c + y),  y + B yᵖ = ‖ε̂‖/e − c,
//               B = b̄ Δt/Δt₀ ((1 + v)/x₀)^{p−1}/vᵖ,  v = sinh η̃,  log p = P tanh(p̃/P) or 0 where c₁
//               ≤ 0,  b̄ = tr(Σ²)/3, Δt₀ = kFlowStep, x₀ = kFlowExcess, P = kFlowPowerLimit;  t' =
//               min(t, e c₂), log Σ' = ‖ε̂‖' ε̂/‖ε̂‖ + t'/3;  F_proj = F bit for bit below both caps,
//               and exp(t'/3) I where c₁ < −½ and t is below its cap
//   stress      (k̃, a₀, ã₁, ã₂, b̃, n₁, γ, δ, n₂, ω, b̃₁, κ̃, ν, β) = f_θ(t/e, q, ℓ, tr D, d, x, z)
//               of the projected F, D = sym(C) t₀,  d ≈ ‖D̂‖,  x = (w:D̂)/(1 + d q),
//               k, a₁, a₂, b, b₁ = sinh(k̃, ã₁, ã₂, b̃, b̃₁), κ = exp κ̃, |ω| ≤ 4,
//               M = (a₁ m(ε − ω t/3; n₁) + a₂ m(ε − ω t/3; n₂))/e,
//               τ = s U [(k m(t; γ, δ)/e + a₀ − a₀(rest) + (1 − β) b tr D/3) I
//                        + M − ω tr(M)/3 I + (b + b₁ (1 + κ² ‖D̂‖²)^ν) D̂] Uᵀ
//               with the strain measures m(·; γ, δ) and m(·; n) = m(·; n/2, n/2) of
//               strain_measure.hpp
//
// The caps are what makes the laws easy: von Mises is a constant c₀; Drucker–Prager a constant m
// with c₂ = 0 (its apex included: c₁ < 0 where t > 0; the slope spans decades with λ/μ, hence the
// sinh); a viscoplastic law keeps a share v/(1 + v) of what exceeds the cap, v = η/(2μ b̄ Δt) (J. C.
// Simo, C. Miehe, CMAME 98, 1992, for b̄), or a power of it (Herschel–Bulkley, p = 1/n; P. Perzyna,
// 1966), which is 0 where all of it is returned at once; v may lie a little below 0, so that a
// training finds that 0 from both sides. Since v goes as 1/Δt, a code serves any time step. A fluid
// is c₁ < 0, an elastic body has both caps out of reach. A fluid's F forgets its shape, and with it
// its orientation: only F Fᵀ enters the stress and the next F Fᵀ, so that dropping the rotation
// moves nothing. Likewise k, a₁, a₂, b, b₁ and the exponents are constants for StVK–Hencky (n₁ = γ
// = δ = 0) and neo-Hookean solids (n₁ = 2), for sums of two terms of Seth and Hill (ω = 0) or of
// Ogden (ω = 1; R. W. Ogden, 1972), for a liquid's equation of state and for a viscous stress whose
// viscosity falls or rises with the rate (P. J. Carreau, 1972). M is the derivative of an energy
// whatever ω. So the networks may answer to z alone: where the weights of their state features are
// all zero, they are asked once, not for every particle. c₂ has min(c₂(rest), 0) and a₀ its own
// answer at F = I, C = 0 taken off, so that nothing yields or moves at rest, whatever the training
// left. Both maps are exactly frame-indifferent. The adjoint goes by divided differences
// (spectral.hpp).

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Planes of an IsotropicTile beside the tapes of its networks.
inline constexpr int kIsotropicPlanes = 59 + padded(kCapOutputs) + padded(kStressOutputs);

/// Scratch numbers of isotropic_evaluate and isotropic_adjoint for one tile.
template <class T>
std::ptrdiff_t isotropic_scratch(const LearnedLaw<T>& law) {
  return law.projection.tape_scratch() + law.stress.tape_scratch() + kTile * kIsotropicPlanes;
}

/// The forward tile: spectral factors and gate inputs are left in `tile` for the adjoint.
template <class T>
struct IsotropicTile {
  T *projection_in, *stress_in, *projection_tape, *stress_tape;
  T *U, *sigma, *V, *grad_projection, *grad_invariants, *grad_direct, *grad_stress;
  T *grad_features, *frame, *strain;
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
    grad_projection = take(padded(kCapOutputs) * kTile);
    grad_invariants = take(4 * kTile);
    grad_direct = take(kTile);
    grad_stress = take(padded(kStressOutputs) * kTile);
    grad_features = take(8 * kTile);
    frame = take(9 * kTile);
    strain = take(4 * kTile);
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

/// A network's answer to a tile; of one that answers to z alone, the answer itself, `constant`.
template <bool keep, class T>
const T* network(const PackedMlp<T>& net, const T* constant, const T* in, T* tape) {
  if (constant) return constant;
  return keep ? mlp_forward_tape(net, in, tape) : mlp_forward(net, in, tape);
}

/// One tile of `count` ≤ kTile particles. `keep` fills what isotropic_adjoint reads; else F_proj is
/// written, if given, and what isotropic_evaluate needs of the projected strain. Returns the two
/// networks' outputs through `h` and `a`.
template <bool keep, class T>
inline void isotropic_tile_forward(const LearnedLaw<T>& law, T flow_time, std::ptrdiff_t count,
                                   View<const T> F_trial, View<const T> C, View<T> F_proj,
                                   const IsotropicTile<T>& tile, const T*& h, const T*& a) {
  using V = Lanes<T>;
  using namespace isotropic_detail;
  constexpr int w = width_of<V>;
  const T e = law.strain_scale;
  const V inv_e(T(1) / e);
  for (std::ptrdiff_t pair = 0; pair < kTile; pair += 2 * w) {
    Svd3<V> svd[2];
    svd3({load_mat3<V, T>(F_trial, pair, count - pair, true),
          load_mat3<V, T>(F_trial, pair + w, count - pair - w, true)},
         svd);
    for (int half = 0; half < 2; ++half) {
      const std::ptrdiff_t l = pair + half * w;
      const Svd3<V>& s = svd[half];
      const HenckyStrain<V> strain = hencky_strain(s.sigma, false);
      for (int k = 0; k < 9; ++k) store_plane(tile.U + k * kTile, l, s.U.e[k]);
      for (int k = 0; k < 9; ++k) store_plane(tile.V + k * kTile, l, s.V_.e[k]);
      for (int k = 0; k < 3; ++k) store_plane(tile.sigma + k * kTile, l, s.sigma[k]);
      store_plane(tile.projection_in, l, strain.trace * inv_e);
      const StrainInvariants<V> invariants = strain_invariants(strain, inv_e);
      store_plane(tile.projection_in + kTile, l, invariants.q);
      store_plane(tile.projection_in + 2 * kTile, l, invariants.cubic);
    }
  }
  h = network<keep>(law.projection, law.constant_projection, tile.projection_in,
                    tile.projection_tape);
  for (std::ptrdiff_t l = 0; l < kTile; l += w) {
    Vec3<V> sigma;
    for (int k = 0; k < 3; ++k) sigma[k] = V::load_aligned(tile.sigma + k * kTile + l);
    const Mat3<V> U = load_plane3<V>(tile.U, l);
    const Gate<V> g =
        gate<V, T>(law, flow_time, hencky_strain(sigma, false), h + l, tile.projection_in + l);
    const StressState<V> s = stress_state<V, T>(U, projected_sigma<V, T>(g, sigma),
                                                load_mat3<V, T>(C, l, count - l, false), e, false);
    store_plane(tile.stress_in, l, s.volumetric);
    store_plane(tile.stress_in + kTile, l, s.invariants.q);
    store_plane(tile.stress_in + 2 * kTile, l, s.invariants.cubic);
    store_plane(tile.stress_in + 3 * kTile, l, s.rate_trace);
    store_plane(tile.stress_in + 4 * kTile, l, s.rate_norm);
    store_plane(tile.stress_in + 5 * kTile, l, s.x);
    if constexpr (!keep) {
      for (int k = 0; k < 3; ++k) store_plane(tile.strain + k * kTile, l, s.h.eps[k]);
      store_plane(tile.strain + 3 * kTile, l, s.h.trace);
      if (F_proj && l < count) {
        const Mat3<V> F = load_mat3<V, T>(F_trial, l, count - l, true);
        store_mat3<V, T>(F_proj, l, count - l, projected_F(g, U, load_plane3<V>(tile.V, l), F));
      }
    }
  }
  a = network<keep>(law.stress, law.constant_stress, tile.stress_in, tile.stress_tape);
}

/// F_trial, C → F_proj, tau for count ≤ kTile particles.
template <class T>
inline void isotropic_evaluate(const LearnedLaw<T>& law, T flow_time, std::ptrdiff_t count,
                               View<const T> F_trial, View<const T> C, View<T> F_proj, View<T> tau,
                               T* scratch) {
  using V = Lanes<T>;
  using namespace isotropic_detail;
  const IsotropicTile<T> tile(law, scratch);
  const T *h, *a;
  isotropic_tile_forward<false>(law, flow_time, count, F_trial, C, F_proj, tile, h, a);
  if (!tau) return;
  for (std::ptrdiff_t l = 0; l < count; l += width_of<V>) {
    StressState<V> s;
    for (int k = 0; k < 3; ++k) s.h.eps[k] = V::load_aligned(tile.strain + k * kTile + l);
    s.h.trace = V::load_aligned(tile.strain + 3 * kTile + l);
    set_rate(load_mat3<V, T>(C, l, count - l, false), s);
    const Mat3<V> in_s = basis_stress(s, load_plane3<V>(tile.U, l), coefficients<V>(law, a + l),
                                      V(T(1) / law.strain_scale));
    store_mat3<V, T>(tau, l, count - l, in_s * V(law.stress_scale));
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
