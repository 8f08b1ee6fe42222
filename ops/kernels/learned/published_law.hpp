#pragma once

#include "ops/kernels/learned/learned_law_table.hpp"
#include "ops/kernels/learned/published_scales.hpp"
#include "ops/kernels/mlp/mlp.hpp"
#include "ops/kernels/spectral/spectral.hpp"

// The published form of the learned law, as published (UniPhy, supplementary, Algorithms 1 and 2):
//   projection  Δ = e_Δ g_φ(((F, U, Σ, Vᵀ) − at rest)/e, z),  F_proj = F + Δ
//   stress      S₁ = f_θ(((Σ, FᵀF, J, log J, F_max, log F_max) − at rest)/e, RᵀCR t₀, z) of the
//               projected F,  F_max = max(F₀₀, 1e-6),  R = U Vᵀ,  τ = s R ½(S₁ + S₁ᵀ) Rᵀ
// with J clamped at 1e-6 in the logarithm; at rest F = U = V = I. It is kept as the reference: the
// factors U and V are not unique at equal singular values, so it is discontinuous there and its
// gradient is regularised (svd3_adjoint). The scales of stress s, strain e, e_Δ = kDeltaOverStrain
// e, and the time unit t₀ are the only additions; one network could not span 1e1 … 1e6 Pa, or learn
// a Δ of a thousandth of its inputs, without them.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

template <class T>
std::ptrdiff_t published_scratch(const LearnedLaw<T>& law) {
  return law.projection.tape_scratch() + law.stress.tape_scratch() + kTile * 196;
}

template <class T>
struct PublishedTile {
  T* trial;                      ///< F, U, Σ, Vᵀ
  T* projected;                  ///< Σ of the projected F
  T *projection_in, *stress_in;  ///< what the networks see, in units of e
  T *grad_projection, *grad_stress, *grad_features;
  T* rotations;  ///< U and V of the projected F
  T *tape, *stress_tape;
  PublishedTile(const LearnedLaw<T>& law, T* scratch) {
    trial = scratch;
    projected = trial + 32 * kTile;
    projection_in = projected + 4 * kTile;
    stress_in = projection_in + 32 * kTile;
    grad_features = stress_in + 28 * kTile;
    grad_projection = grad_features + 32 * kTile;
    grad_stress = grad_projection + 12 * kTile;
    rotations = grad_stress + 12 * kTile;
    tape = rotations + 18 * kTile;
    stress_tape = tape + law.projection.tape_scratch();
  }
};

namespace published_detail {

template <class V, class T>
UNIPHY_INLINE void put(T* planes, int row, std::ptrdiff_t l, const V& value) {
  value.store_aligned(planes + row * kTile + l);
}
template <class V, class T>
UNIPHY_INLINE void put3(T* planes, int row, std::ptrdiff_t l, const Mat3<V>& m) {
  for (int k = 0; k < 9; ++k) put(planes, row + k, l, m.e[k]);
}
template <class V, class T>
UNIPHY_INLINE Mat3<V> get3(const T* planes, int row, std::ptrdiff_t l) {
  Mat3<V> m;
  for (int k = 0; k < 9; ++k) m.e[k] = V::load_aligned(planes + (row + k) * kTile + l);
  return m;
}

/// The decompositions that published_tile_forward has left: of F, of the projected F.
template <class V, class T>
UNIPHY_INLINE Svd3<V> trial_svd(const PublishedTile<T>& tile, std::ptrdiff_t l) {
  Svd3<V> s;
  s.U = get3<V>(tile.trial, 9, l);
  for (int i = 0; i < 3; ++i) s.sigma[i] = V::load_aligned(tile.trial + (18 + i) * kTile + l);
  s.V_ = transpose(get3<V>(tile.trial, 21, l));
  return s;
}
template <class V, class T>
UNIPHY_INLINE Svd3<V> projected_svd(const PublishedTile<T>& tile, std::ptrdiff_t l) {
  Svd3<V> s;
  s.U = get3<V>(tile.rotations, 0, l);
  for (int i = 0; i < 3; ++i) s.sigma[i] = V::load_aligned(tile.projected + i * kTile + l);
  s.V_ = get3<V>(tile.rotations, 9, l);
  return s;
}
template <class V, class T>
UNIPHY_INLINE Mat3<V> projected_rotation(const PublishedTile<T>& tile, std::ptrdiff_t l) {
  return mult(get3<V>(tile.rotations, 0, l), get3<V>(tile.rotations, 9, l));
}

/// (m − I) times `scale`.
template <class V>
UNIPHY_INLINE Mat3<V> from_rest(Mat3<V> m, const V& scale) {
  const V one(ScalarOf<V>(1));
  for (int k = 0; k < 9; ++k) m.e[k] = (k % 4 == 0 ? m.e[k] - one : m.e[k]) * scale;
  return m;
}
/// The projected F.
template <class V, class T>
UNIPHY_INLINE Mat3<V> projected_F(const LearnedLaw<T>& law, const PublishedTile<T>& tile,
                                  const T* delta, std::ptrdiff_t l) {
  return get3<V>(tile.trial, 0, l) +
         get3<V>(delta, 0, l) * V(T(kDeltaOverStrain) * law.strain_scale);
}

/// What the stress of one vector of particles is made of.
template <class V>
struct StressInputs {
  Mat3<V> R, right;  ///< right = FᵀF
  V J, J_safe, F_max;
};
template <class V>
UNIPHY_INLINE StressInputs<V> stress_inputs(const Mat3<V>& F, const Svd3<V>& svd) {
  const V floor(ScalarOf<V>(1e-6));
  StressInputs<V> s;
  s.R = mult(svd.U, svd.V_);
  s.right = tmul(F, F);
  s.J = determinant(F);
  s.J_safe = lane_max(s.J, floor);
  s.F_max = lane_max(F(0, 0), floor);
  return s;
}

}  // namespace published_detail

/// Runs both networks on one tile; returns Δ and S₁ as planes.
template <bool keep, class T>
inline void published_tile_forward(const LearnedLaw<T>& law, std::ptrdiff_t count,
                                   View<const T> F_trial, View<const T> C,
                                   const PublishedTile<T>& tile, const T*& delta, const T*& S1) {
  using V = Lanes<T>;
  using namespace published_detail;
  constexpr int w = width_of<V>;
  const V one(T(1)), inv_e(T(1) / law.strain_scale);
  for (std::ptrdiff_t pair = 0; pair < kTile; pair += 2 * w) {
    const Mat3<V> F[2] = {load_mat3<V, T>(F_trial, pair, count - pair, true),
                          load_mat3<V, T>(F_trial, pair + w, count - pair - w, true)};
    Svd3<V> svd[2];
    svd3(F, svd);
    for (int half = 0; half < 2; ++half) {
      const std::ptrdiff_t l = pair + half * w;
      const Mat3<V> right = transpose(svd[half].V_);
      put3(tile.trial, 0, l, F[half]);
      put3(tile.trial, 9, l, svd[half].U);
      for (int i = 0; i < 3; ++i) put(tile.trial, 18 + i, l, svd[half].sigma[i]);
      put3(tile.trial, 21, l, right);
      put3(tile.projection_in, 0, l, from_rest(F[half], inv_e));
      put3(tile.projection_in, 9, l, from_rest(svd[half].U, inv_e));
      for (int i = 0; i < 3; ++i)
        put(tile.projection_in, 18 + i, l, (svd[half].sigma[i] - one) * inv_e);
      put3(tile.projection_in, 21, l, from_rest(right, inv_e));
    }
  }
  delta = keep ? mlp_forward_tape(law.projection, tile.projection_in, tile.tape)
               : mlp_forward(law.projection, tile.projection_in, tile.tape);
  for (std::ptrdiff_t pair = 0; pair < kTile; pair += 2 * w) {
    Mat3<V> F[2];
    Svd3<V> svd[2];
    for (int half = 0; half < 2; ++half) {
      F[half] = projected_F<V>(law, tile, delta, pair + half * w);
    }
    svd3(F, svd);
    for (int half = 0; half < 2; ++half) {
      const std::ptrdiff_t l = pair + half * w;
      const StressInputs<V> s = stress_inputs(F[half], svd[half]);
      put3(tile.rotations, 0, l, svd[half].U);
      put3(tile.rotations, 9, l, svd[half].V_);
      for (int i = 0; i < 3; ++i) {
        put(tile.projected, i, l, svd[half].sigma[i]);
        put(tile.stress_in, i, l, (svd[half].sigma[i] - one) * inv_e);
      }
      put3(tile.stress_in, 3, l, from_rest(s.right, inv_e));
      put(tile.stress_in, 12, l, (s.J - one) * inv_e);
      put(tile.stress_in, 13, l, lane_log(s.J_safe) * inv_e);
      put(tile.stress_in, 14, l, (s.F_max - one) * inv_e);
      put(tile.stress_in, 15, l, lane_log(s.F_max) * inv_e);
      const Mat3<V> rate = load_mat3<V, T>(C, l, count - l, false);
      put3(tile.stress_in, 16, l, tmul(s.R, mul(rate, s.R)) * V(T(kTimeScale)));
    }
  }
  S1 = keep ? mlp_forward_tape(law.stress, tile.stress_in, tile.stress_tape)
            : mlp_forward(law.stress, tile.stress_in, tile.stress_tape);
}

/// F_trial, C → F_proj, tau for count ≤ kTile particles.
template <class T>
inline void published_evaluate(const LearnedLaw<T>& law, std::ptrdiff_t count,
                               View<const T> F_trial, View<const T> C, View<T> F_proj, View<T> tau,
                               T* scratch) {
  using V = Lanes<T>;
  using namespace published_detail;
  const PublishedTile<T> tile(law, scratch);
  const T *delta, *S1;
  published_tile_forward<false>(law, count, F_trial, C, tile, delta, S1);
  for (std::ptrdiff_t l = 0; l < count; l += width_of<V>) {
    const Mat3<V> F = projected_F<V>(law, tile, delta, l);
    if (F_proj) store_mat3<V, T>(F_proj, l, count - l, F);
    if (!tau) continue;
    const Mat3<V> R = projected_rotation<V>(tile, l);
    store_mat3<V, T>(tau, l, count - l,
                     mult(mul(R, sym(get3<V>(S1, 0, l))), R) * V(law.stress_scale));
  }
}

/// The adjoint of published_evaluate, recomputing its forward pass tile by tile. Overwrites
/// grad_F_trial, adds to grad_C, accumulator and weight_sums (each may be null).
template <class T>
inline void published_adjoint(const LearnedLaw<T>& law, std::ptrdiff_t count, View<const T> F_trial,
                              View<const T> C, View<const T> grad_F_proj, View<const T> grad_tau,
                              View<T> grad_F_trial, View<T> grad_C, T* accumulator, T* weight_sums,
                              T* scratch) {
  using V = Lanes<T>;
  using namespace published_detail;
  constexpr int w = width_of<V>;
  const PublishedTile<T> tile(law, scratch);
  const T *delta, *S1;
  published_tile_forward<true>(law, count, F_trial, C, tile, delta, S1);
  const V scale(law.stress_scale), zero(T(0)), one(T(1)), floor(T(1e-6)), t0 = V(T(kTimeScale));
  const V inv_e(T(1) / law.strain_scale), delta_scale(T(kDeltaOverStrain) * law.strain_scale);
  V sum_log_s = zero, sum_log_e = zero;
  // What the features of a network, `features_in_e` of which are in units of e, give to log e.
  const auto of_features = [&](const T* features, int features_in_e, std::ptrdiff_t l) {
    V sum = zero;
    for (int k = 0; k < features_in_e; ++k)
      sum = sum + V::load_aligned(tile.grad_features + k * kTile + l) *
                      V::load_aligned(features + k * kTile + l);
    return sum;
  };
  for (std::ptrdiff_t l = 0; l < kTile; l += w) {
    const Mat3<V> R = projected_rotation<V>(tile, l);
    const Mat3<V> gt = sym(load_mat3<V, T>(grad_tau, l, count - l, false)) * scale;
    const Mat3<V> gS = tmul(R, mul(gt, R));
    put3(tile.grad_stress, 0, l, gS);
    sum_log_s = sum_log_s + dot(gS, sym(get3<V>(S1, 0, l)));
  }
  mlp_backward<T>(law.stress, tile.stress_in, tile.stress_tape, tile.grad_stress,
                  tile.grad_features,
                  accumulator ? accumulator + law.projection.layer[0].out : nullptr,
                  weight_sums ? weight_sums + law.stress_weight_sums() : nullptr);
  for (std::ptrdiff_t l = 0; l < kTile; l += w) {
    const Mat3<V> F = projected_F<V>(law, tile, delta, l);
    const Svd3<V> svd = projected_svd<V>(tile, l);
    const StressInputs<V> s = stress_inputs(F, svd);
    const Mat3<V> rate = load_mat3<V, T>(C, l, count - l, false);
    const Mat3<V> gt = sym(load_mat3<V, T>(grad_tau, l, count - l, false)) * scale;
    const auto feature = [&](int k) {
      return V::load_aligned(tile.grad_features + k * kTile + l) * inv_e;
    };
    const Mat3<V> g_right = get3<V>(tile.grad_features, 3, l) * inv_e;
    sum_log_e = sum_log_e - of_features(tile.stress_in, 16, l);
    const Mat3<V> g_rate = get3<V>(tile.grad_features, 16, l) * t0;

    // τ = R Ŝ Rᵀ and Ĉ = Rᵀ C R, both through R.
    Mat3<V> gR = mul(gt, mul(s.R, sym(get3<V>(S1, 0, l)))) * V(T(2));
    gR = gR + mul(rate, mult(s.R, g_rate)) + tmul(rate, mul(s.R, g_rate));
    const Mat3<V> P = tmul(svd.U, mul(gR, svd.V_));
    Mat3<V> A = zero3<V>();
    for (int i = 0; i < 3; ++i) A(i, i) = feature(i);
    for (int k = 0; k < 3; ++k) {
      const int i = kPair[k][0], j = kPair[k][1];
      // R = U 1 Vᵀ: the divided difference is 0, the divided sum 2/(σi + σj).
      const V a = (P(i, j) - P(j, i)) * inverse_sum(svd.sigma[i], svd.sigma[j]);
      A(i, j) = a;
      A(j, i) = -a;
    }
    Mat3<V> gF = mult(mul(svd.U, A), svd.V_);
    gF = gF + mul(F, g_right + transpose(g_right));
    const V g_J = feature(12) + select<V>(s.J > floor, feature(13) / s.J_safe, zero);
    gF = gF + cofactor(F) * g_J;
    gF(0, 0) = gF(0, 0) + select<V>(F(0, 0) > floor, feature(14) + feature(15) / s.F_max, zero);
    gF = gF + load_mat3<V, T>(grad_F_proj, l, count - l, false);
    put3(tile.grad_stress, 0, l, gF);  // those of S₁ have been used
    put3(tile.grad_projection, 0, l, gF * delta_scale);
    sum_log_e = sum_log_e + dot(gF, get3<V>(delta, 0, l)) * delta_scale;
    if (grad_C && l < count)
      store_mat3<V, T>(grad_C, l, count - l, mult(mul(s.R, g_rate), s.R), true);
  }
  mlp_backward<T>(law.projection, tile.projection_in, tile.tape, tile.grad_projection,
                  tile.grad_features, accumulator, weight_sums);
  for (std::ptrdiff_t l = 0; l < count; l += w) {
    Vec3<V> g_sigma;
    for (int i = 0; i < 3; ++i)
      g_sigma[i] = V::load_aligned(tile.grad_features + (18 + i) * kTile + l) * inv_e;
    const Mat3<V> g = svd3_adjoint(trial_svd<V>(tile, l), get3<V>(tile.grad_features, 9, l) * inv_e,
                                   g_sigma, transpose(get3<V>(tile.grad_features, 21, l)) * inv_e) +
                      get3<V>(tile.grad_features, 0, l) * inv_e + get3<V>(tile.grad_stress, 0, l);
    sum_log_e = sum_log_e - of_features(tile.projection_in, 30, l);
    if (grad_F_trial) store_mat3<V, T>(grad_F_trial, l, count - l, g);
  }
  if (accumulator) {
    accumulator[law.scale_sums()] += lane_sum(sum_log_s);
    accumulator[law.scale_sums() + 1] += lane_sum(sum_log_e);
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
