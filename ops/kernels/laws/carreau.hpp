#pragma once

#include "ops/kernels/laws/water.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Weakly compressible fluid that thins (n < 1) or thickens (n > 1) with the rate of shear:
/// τ = λ J (J − 1) I + 2 η(γ̇) dev D, D = ½ (C + Cᵀ), γ̇ = √(2 dev D : dev D),
/// η(γ̇) = η_∞ + (η − η_∞) (1 + (κ γ̇)²)^{(n−1)/2}. λ in Pa, η (at rest) and η_∞ in Pa s, κ in s.
/// P. J. Carreau, Rheological equations from molecular network theories, Trans. Soc. Rheol. 16,
/// 1972.
struct Carreau {
  /// The viscosity and what it is made of; s = γ̇².
  template <class V>
  struct Viscosity {
    Mat3<V> D;           ///< dev D
    V s, base, power;    ///< base = 1 + κ² s, power = base^{(n−1)/2}
    V logarithm, value;  ///< log base, η(γ̇)
  };
  template <class V>
  static UNIPHY_INLINE Viscosity<V> viscosity(const Mat3<V>& C, const Material<V>& m) {
    using T = ScalarOf<V>;
    const V one(T(1));
    Viscosity<V> v;
    v.D = sym(C);
    const V mean = trace(v.D) * V(T(1.0 / 3));
    for (int i = 0; i < 3; ++i) v.D(i, i) = v.D(i, i) - mean;
    v.s = V(T(2)) * dot(v.D, v.D);
    v.base = lane_fma(m.kappa * m.kappa, v.s, one);
    v.logarithm = lane_log(v.base);
    v.power = lane_exp(V(T(0.5)) * (m.n - one) * v.logarithm);
    v.value = lane_fma(m.eta - m.eta_inf, v.power, m.eta_inf);
    return v;
  }

  template <class V>
  static UNIPHY_INLINE Mat3<V> stress(const Mat3<V>& F, const Mat3<V>& C, const Material<V>& m) {
    const Viscosity<V> v = viscosity(C, m);
    return Water::stress(F, C, m) + v.D * (v.value + v.value);
  }

  /// The viscous part: dL/dD = 2 η dev G + 8 η' (G : dev D) dev D with η' = dη/ds.
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress_adjoint(const Mat3<V>& F, const Mat3<V>& C,
                                              const Material<V>& m, const Mat3<V>& grad,
                                              Mat3<V>& grad_C, MaterialGradient<V>& g) {
    using T = ScalarOf<V>;
    const V one(T(1)), half(T(0.5)), two(T(2));
    const Viscosity<V> v = viscosity(C, m);
    Mat3<V> G = sym(grad);
    const V mean = trace(G) * V(T(1.0 / 3));
    for (int i = 0; i < 3; ++i) G(i, i) = G(i, i) - mean;
    const V of_value = two * dot(G, v.D);
    const V gap = m.eta - m.eta_inf, bend = half * (m.n - one) * gap * v.power / v.base;
    grad_C =
        grad_C + G * (v.value + v.value) + v.D * (V(T(4)) * of_value * bend * m.kappa * m.kappa);
    g.eta = g.eta + of_value * v.power;
    g.eta_inf = g.eta_inf + of_value * (one - v.power);
    g.kappa = g.kappa + of_value * bend * two * m.kappa * v.s;
    g.n = g.n + of_value * half * gap * v.power * v.logarithm;
    return Water::stress_adjoint(F, C, m, grad, grad_C, g);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
