#pragma once

#include "ops/kernels/laws/material.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Inviscid fluid of the NCLaw benchmark: τ = λ J (J − 1) I, J = det F; λ in Pa.
/// P. Ma et al., Learning Neural Constitutive Laws from Motion Observations, ICML 2023.
struct Water {
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                      const Material<V>& m) {
    const V J = determinant(F);
    const V pressure = m.lambda * J * (J - V(ScalarOf<V>(1)));
    Mat3<V> tau = zero3<V>();
    for (int i = 0; i < 3; ++i) tau(i, i) = pressure;
    return tau;
  }

  /// dL/dF = λ (2J − 1) tr(dL/dτ) cof F, dL/dλ = J (J − 1) tr(dL/dτ).
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress_adjoint(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                              const Material<V>& m, const Mat3<V>& G,
                                              Mat3<V>& /*grad_C*/, MaterialGradient<V>& g) {
    const V one(ScalarOf<V>(1)), J = determinant(F), trace_G = trace(G);
    g.lambda = g.lambda + J * (J - one) * trace_G;
    return cofactor(F) * (m.lambda * (J + J - one) * trace_G);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
