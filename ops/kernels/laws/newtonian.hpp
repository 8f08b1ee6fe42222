#pragma once

#include "ops/kernels/laws/clamped_volume.hpp"
#include "ops/kernels/laws/material.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Weakly compressible Newtonian fluid: τ = κ (J − J⁻⁶) I + ½ μ (C + Cᵀ), κ = ⅔ μ + λ.
/// C (1/s) stands for ∇v; λ and κ in Pa, μ in Pa s (its ⅔ enters κ as a number).
/// J = max(det F, floor), with the floor of the volumetric projection, 1e-6, in float64 and 1e-4 in
/// float32, where J⁻⁷ of anything smaller would not fit.
struct Newtonian {
  template <class T>
  static constexpr T minimum_J() {
    return sizeof(T) == 8 ? T(1e-6) : T(1e-4);
  }
  template <class V>
  static UNIPHY_INLINE V inverse_sixth_power(const V& J) {
    const V inverse = V(ScalarOf<V>(1)) / J, cube = inverse * inverse * inverse;
    return cube * cube;
  }

  template <class V>
  static UNIPHY_INLINE Mat3<V> stress(const Mat3<V>& F, const Mat3<V>& C, const Material<V>& m) {
    using T = ScalarOf<V>;
    const V J = clamped_volume(determinant(F), V(minimum_J<T>()));
    const V kappa = lane_fma(V(T(2.0 / 3)), m.mu, m.lambda);
    const V pressure = kappa * (J - inverse_sixth_power(J));
    Mat3<V> tau = sym(C) * m.mu;
    for (int i = 0; i < 3; ++i) tau(i, i) = tau(i, i) + pressure;
    return tau;
  }

  /// With G = dL/dτ: dL/dF = κ (1 + 6 J⁻⁷) tr(G) cof F, dL/dC = μ sym G,
  /// dL/dμ = G : sym C + ⅔ (J − J⁻⁶) tr G, dL/dλ = (J − J⁻⁶) tr G.
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress_adjoint(const Mat3<V>& F, const Mat3<V>& C,
                                              const Material<V>& m, const Mat3<V>& G,
                                              Mat3<V>& grad_C, MaterialGradient<V>& g) {
    using T = ScalarOf<V>;
    const V floor = V(minimum_J<T>()), det = determinant(F), J = clamped_volume(det, floor);
    const V kappa = lane_fma(V(T(2.0 / 3)), m.mu, m.lambda);
    const V sixth = inverse_sixth_power(J), trace_G = trace(G);
    const Mat3<V> symmetric = sym(G);
    const V volume = (J - sixth) * trace_G;
    g.mu = g.mu + dot(symmetric, C) + V(T(2.0 / 3)) * volume;
    g.lambda = g.lambda + volume;
    grad_C = grad_C + symmetric * m.mu;
    const V slope = kappa * (V(T(1)) + V(T(6)) * sixth / J) * trace_G;
    return cofactor(F) * select<V>(det < floor, V(T(0)), slope);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
