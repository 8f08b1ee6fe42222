#pragma once

#include "ops/kernels/laws/clamped_volume.hpp"
#include "ops/kernels/laws/material.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Mooney–Rivlin solid, rubber at moderate strain: with B̄ = J^{-2/3} F Fᵀ,
/// τ = dev(2 (c₁ + c₂ tr B̄) B̄ − 2 c₂ B̄²) + λ J (J − 1) I. c₁, c₂, λ in Pa; J = max(det F, 1e-6).
/// R. S. Rivlin, Large elastic deformations of isotropic materials IV, Phil. Trans. R. Soc. A 241,
/// 1948; the split by volume as in G. A. Holzapfel, Nonlinear Solid Mechanics, section 6.5.
struct MooneyRivlin {
  template <class V>
  struct State {
    V det, J, shrink;  ///< shrink = J^{-2/3}
    Mat3<V> B;         ///< B̄
  };
  template <class V>
  static UNIPHY_INLINE State<V> state(const Mat3<V>& F) {
    using T = ScalarOf<V>;
    State<V> s;
    s.det = determinant(F);
    s.J = clamped_volume(s.det, V(T(kMinimumJ)));
    const V root = cbrt_positive(s.J);
    s.shrink = V(T(1)) / (root * root);
    s.B = mult(F, F) * s.shrink;
    return s;
  }

  template <class V>
  static UNIPHY_INLINE Mat3<V> stress(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                      const Material<V>& m) {
    using T = ScalarOf<V>;
    const V two(T(2));
    const State<V> s = state(F);
    Mat3<V> tau = s.B * (two * lane_fma(m.c2, trace(s.B), m.c1)) - mul(s.B, s.B) * (two * m.c2);
    const V shift = m.lambda * s.J * (s.J - V(T(1))) - trace(tau) * V(T(1.0 / 3));
    for (int i = 0; i < 3; ++i) tau(i, i) = tau(i, i) + shift;
    return tau;
  }

  /// With G = sym(dL/dτ) and Ĝ = dev G: dL/dB̄ = 2 (c₁ + c₂ tr B̄) Ĝ + 2 c₂ ((Ĝ : B̄) I − Ĝ B̄ − B̄ Ĝ),
  /// dL/dF = 2 J^{-2/3} (dL/dB̄) F + (λ (2J − 1) tr G − ⅔ (dL/dB̄ : B̄)/J) cof F.
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress_adjoint(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                              const Material<V>& m, const Mat3<V>& grad,
                                              Mat3<V>& /*grad_C*/, MaterialGradient<V>& g) {
    using T = ScalarOf<V>;
    const V zero(T(0)), one(T(1)), two(T(2));
    const State<V> s = state(F);
    Mat3<V> G = sym(grad);
    const V trace_G = trace(G);
    for (int i = 0; i < 3; ++i) G(i, i) = G(i, i) - trace_G * V(T(1.0 / 3));
    const V GB = dot(G, s.B), trace_B = trace(s.B), two_c2 = two * m.c2;
    const Mat3<V> product = mul(G, s.B);
    Mat3<V> of_B =
        G * (two * lane_fma(m.c2, trace_B, m.c1)) - (product + transpose(product)) * two_c2;
    for (int i = 0; i < 3; ++i) of_B(i, i) = lane_fma(two_c2, GB, of_B(i, i));
    g.c1 = g.c1 + two * GB;
    g.c2 = g.c2 + two * (trace_B * GB - dot(product, s.B));
    g.lambda = g.lambda + s.J * (s.J - one) * trace_G;
    const V of_J = m.lambda * (s.J + s.J - one) * trace_G - V(T(2.0 / 3)) * dot(of_B, s.B) / s.J;
    return mul(of_B, F) * (two * s.shrink) +
           cofactor(F) * select<V>(s.det < V(T(kMinimumJ)), zero, of_J);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
