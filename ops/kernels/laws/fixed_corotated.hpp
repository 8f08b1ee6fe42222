#pragma once

#include "ops/kernels/laws/material.hpp"
#include "ops/kernels/spectral/spectral.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Fixed-corotated solid: τ = 2μ (F − R) Fᵀ + λ J (J − 1) I with R = U Vᵀ, that is
/// τ = U diag(2μ σ (σ − 1) + λ J (J − 1)) Uᵀ, J = σ₁ σ₂ σ₃; μ, λ in Pa. Defined for every F.
/// A. Stomakhin et al., Energetically consistent invertible elasticity, SCA 2012.
struct FixedCorotated {
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                      const Material<V>& m) {
    using T = ScalarOf<V>;
    const V one(T(1)), two(T(2));
    const Svd3<V> s = svd3(F);
    const V J = s.sigma[0] * s.sigma[1] * s.sigma[2];
    const V pressure = m.lambda * J * (J - one);
    Vec3<V> t;
    for (int i = 0; i < 3; ++i)
      t[i] = lane_fma(two * m.mu * s.sigma[i], s.sigma[i] - one, pressure);
    return compose(s.U, t, s.U);
  }

  /// In the frame (U, V), with S = Uᵀ sym(dL/dτ) U: the divided difference of 2μ σ (σ − 1) is
  /// 2μ (σi + σj − 1); J turns only the diagonal.
  template <class V>
  static UNIPHY_INLINE Mat3<V> stress_adjoint(const Mat3<V>& F, const Mat3<V>& /*C*/,
                                              const Material<V>& m, const Mat3<V>& G,
                                              Mat3<V>& /*grad_C*/, MaterialGradient<V>& g) {
    using T = ScalarOf<V>;
    const V one(T(1)), two(T(2));
    const Svd3<V> s = svd3(F);
    const Vec3<V>& sigma = s.sigma;
    const Mat3<V> S = mul(tmul(s.U, sym(G)), s.U);
    const V J = sigma[0] * sigma[1] * sigma[2], trace_S = trace(S);
    const V slope_J = m.lambda * (J + J - one) * trace_S;
    Mat3<V> B = zero3<V>();
    Vec3<V> divided;
    V of_mu(T(0));
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      B(i, i) =
          lane_fma(two * m.mu * S(i, i), sigma[i] + sigma[i] - one, slope_J * sigma[j] * sigma[k]);
      of_mu = lane_fma(S(i, i) * sigma[i], sigma[i] - one, of_mu);
    }
    for (int k = 0; k < 3; ++k)
      divided[k] = two * m.mu * (sigma[kPair[k][0]] + sigma[kPair[k][1]] - one);
    add_symmetric_adjoint(sigma, divided, S, B);
    g.mu = g.mu + two * of_mu;
    g.lambda = g.lambda + J * (J - one) * trace_S;
    return mult(mul(s.U, B), s.V_);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
