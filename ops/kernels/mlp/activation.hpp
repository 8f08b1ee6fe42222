#pragma once

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/kernels/simd/lanes.hpp"

// The activations of the learned networks, one particle a lane. They are a third of the time of a
// narrow network, so their exponential does without the checks of a general one. The coefficients:
// activation_polynomials.py, which yields those of least largest error and holds these to it.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// c^x, given log₂ c: 2^(n + r), n an integer, with the polynomial in r of least largest relative
/// error, 9e-8, on [−½, ½]. For |x log₂ c| ≤ 120; the rounding of log₂ c counts |x| times.
template <class V>
UNIPHY_INLINE V bounded_power(const V& x, const V& log2_of_base) {
  const V n = xsimd::nearbyint(x * log2_of_base);
  const V r = lane_fma(x, log2_of_base, -n);
  V p(1.32647256236e-3F);
  p = lane_fma(p, r, V(9.67151309290e-3F));
  p = lane_fma(p, r, V(5.55073375169e-2F));
  p = lane_fma(p, r, V(0.240222420776F));
  p = lane_fma(p, r, V(0.693146977592F));
  p = lane_fma(p, r, V(1.0F));
  return xsimd::ldexp(p, xsimd::to_int(n));
}
/// e^x for |x| ≤ 80.
template <class V>
UNIPHY_INLINE V bounded_exp(const V& x) {
  if constexpr (is_scalar_lane<V> || sizeof(ScalarOf<V>) != sizeof(float)) {
    return lane_exp(x);
  } else {
    return bounded_power(x, V(1.44269504F));
  }
}

/// gelu of float lanes to 2e-7 of max(1, |x|), its slope to 2e-7: cheaper than by an erf, and
/// without its branches.
///   Φ(x) − ½ = x P(x²)/Q(x²) of least largest error on [−6, 6], 2e-8; ±½ to rounding beyond
///   slope    = Φ(x) + x φ(x)
template <class V>
UNIPHY_INLINE V gelu_lanes(const V& x, V* slope) {
  const V within = lane_max(V(-6.0F), lane_min(V(6.0F), x)), square = within * within;
  V p(2.0153884673e-8F), q(1.1330968479e-6F);
  p = lane_fma(p, square, V(6.5132488028e-6F));
  q = lane_fma(q, square, V(8.3075380003e-5F));
  p = lane_fma(p, square, V(1.9913140766e-4F));
  q = lane_fma(q, square, V(2.0573727601e-3F));
  p = lane_fma(p, square, V(4.8628185747e-3F));
  q = lane_fma(q, square, V(3.0376600194e-2F));
  p = lane_fma(p, square, V(3.6876552903e-2F));
  q = lane_fma(q, square, V(0.25910027601F));
  p = lane_fma(p, square, V(0.39894214026F));
  q = lane_fma(q, square, V(1.0F));
  const V phi = lane_fma(within, p / q, V(0.5F));
  if (slope) {
    const V density = V(0.39894228F) * bounded_power(square, V(-0.72134752F));
    *slope = lane_fma(within, density, phi);
  }
  return x * phi;
}

/// The value of an activation and, where asked, its derivative.
template <Activation A, class V>
UNIPHY_INLINE V activate(const V& x, V* slope) {
  using T = ScalarOf<V>;
  const V one(T(1)), half(T(0.5));
  if constexpr (A == Activation::gelu && !is_scalar_lane<V> && sizeof(T) == sizeof(float)) {
    return gelu_lanes(x, slope);
  } else if constexpr (A == Activation::gelu) {
    const V phi = lane_fma(half, lane_erf(x * V(T(0.70710678118654752440))), half);
    if (slope)
      *slope = lane_fma(x * V(T(0.39894228040143267794)), lane_exp(x * x * V(T(-0.5))), phi);
    return x * phi;
  } else if constexpr (A == Activation::silu) {
    // Bounded so that the exponential stays finite; sigma is 0 or 1 to rounding there.
    const V within = lane_max(V(T(-80)), lane_min(V(T(80)), x));
    const V sigma = one / (one + bounded_exp(-within));
    if (slope) *slope = sigma * lane_fma(x, one - sigma, one);
    return x * sigma;
  } else {
    const V root = lane_sqrt(lane_fma(x, x, V(T(4))));
    if (slope) *slope = lane_fma(half, x / root, half);
    return lane_fma(half, x + root, V(T(-1)));
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
