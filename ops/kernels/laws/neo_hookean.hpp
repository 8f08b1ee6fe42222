#pragma once

#include "ops/kernels/laws/clamped_volume.hpp"
#include "ops/kernels/laws/material.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Compressible neo-Hookean solid: τ = μ F Fᵀ + (λ log J − μ) I, J = max(det F, 1e-6).
/// F is dimensionless; τ, μ, λ in Pa.
/// J. Bonet, R. D. Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, section 6.4.3.
struct NeoHookean {
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                      const Material<V>& m) {
    const V J = clamped_volume(determinant(F), V(ScalarOf<V>(kMinimumJ)));
    const V shift = m.lambda * lane_log(J) - m.mu;
    Mat3<V> tau = mult(F, F) * m.mu;
    for (int i = 0; i < 3; ++i) tau(i, i) = tau(i, i) + shift;
    return tau;
  }

  /// dL/dF = μ (G + Gᵀ) F + λ tr(G)/J cof F with G = dL/dτ; dL/dμ = G : (F Fᵀ − I),
  /// dL/dλ = tr(G) log J.
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress_adjoint(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                              const Material<V>& m, const Mat3<V>& G,
                                              Mat3<V>& /*grad_C*/, MaterialGradient<V>& g) {
    using T = ScalarOf<V>;
    const V floor = V(T(kMinimumJ)), det = determinant(F), J = clamped_volume(det, floor);
    const V trace_G = trace(G);
    const V slope = select<V>(det < floor, V(T(0)), m.lambda * trace_G / J);
    g.mu = g.mu + dot(G, mult(F, F)) - trace_G;
    g.lambda = g.lambda + trace_G * lane_log(J);
    return mul(G + transpose(G), F) * m.mu + cofactor(F) * slope;
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
