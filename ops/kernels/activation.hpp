#pragma once

#include "ops/kernels/lanes.hpp"
#include "ops/kernels/learned_law_weights.hpp"

// The activations of the learned networks, one particle a lane. They are a third of the time of a
// narrow network, so the exponential of silu does without the checks of a general one.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// e^x for |x| ≤ 80 to 1.5 units in the last place (float; others: lane_exp). 2^r on [−1/2, 1/2] is
/// the polynomial of least largest relative error, 2e-9.
template <class V>
UNIPHY_INLINE V bounded_exp(const V& x) {
  using T = ScalarOf<V>;
  if constexpr (is_scalar_lane<V> || sizeof(T) != sizeof(float)) {
    return lane_exp(x);
  } else {
    // x/log 2 = n + r, 1/log 2 in two parts so that r keeps its last bits.
    const V n = xsimd::nearbyint(x * V(1.44269502F));
    const V r = fma(x, V(1.92596303e-8F), fma(x, V(1.44269502F), -n));
    V p(1.53458273815e-4F);
    p = fma(p, r, V(1.33999307896e-3F));
    p = fma(p, r, V(9.61848889795e-3F));
    p = fma(p, r, V(5.55032877851e-2F));
    p = fma(p, r, V(2.40226468912e-1F));
    p = fma(p, r, V(6.93147205736e-1F));
    p = fma(p, r, V(1.0F));
    return xsimd::ldexp(p, xsimd::to_int(n));
  }
}

/// The value of an activation and, where asked, its derivative.
template <Activation A, class V>
UNIPHY_INLINE V activate(const V& x, V* slope) {
  using T = ScalarOf<V>;
  const V one(T(1)), half(T(0.5));
  if constexpr (A == Activation::gelu) {
    const V phi = fma(half, lane_erf(x * V(T(0.70710678118654752440))), half);
    if (slope) *slope = fma(x * V(T(0.39894228040143267794)), lane_exp(x * x * V(T(-0.5))), phi);
    return x * phi;
  } else if constexpr (A == Activation::silu) {
    // Bounded so that the exponential stays finite; sigma is 0 or 1 to rounding there.
    const V within = lane_max(V(T(-80)), lane_min(V(T(80)), x));
    const V sigma = one / (one + bounded_exp(-within));
    if (slope) *slope = sigma * fma(x, one - sigma, one);
    return x * sigma;
  } else {
    const V root = lane_sqrt(fma(x, x, V(T(4))));
    if (slope) *slope = fma(half, x / root, half);
    return fma(half, x + root, V(T(-1)));
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
