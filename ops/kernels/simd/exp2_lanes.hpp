#pragma once

#include <cstdint>
#include <cstring>

#include "ops/kernels/simd/lanes.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Smallest exponent that exp2_lanes tells from others: 2^-1000 is 9e-302.
inline constexpr double kLeastExponent = -1000;

/// 2^x of double lanes to 2e-14 of it, for x ≤ 1000; below kLeastExponent it stays 2^-1000. NaN
/// stays NaN. 2^n is an integer in the bits of the exponent; 2^r, r in [−½, ½], the polynomial of
/// least largest relative error, 1.5e-14 (power_of_two(9) of mlp/activation_polynomials.py).
/// Without the division and the checks of a general exponential.
template <class V>
UNIPHY_INLINE V exp2_lanes(const V& exponent) {
  const V x = lane_max(V(kLeastExponent), exponent);
  if constexpr (is_scalar_lane<V>) {
    return std::exp2(x);
  } else {
    using Integers = xsimd::as_integer_t<V>;
    const V magic(6755399441055744.0);  // 1.5 · 2^52: the sum has round(x) in its last bits
    const V shifted = x + magic, r = x - (shifted - magic);
    V p(1.01483407940975609e-7);
    p = lane_fma(p, r, V(1.32583354151976945e-6));
    p = lane_fma(p, r, V(1.52529900145028024e-5));
    p = lane_fma(p, r, V(1.54034408844071579e-4));
    p = lane_fma(p, r, V(1.33335576254726112e-3));
    p = lane_fma(p, r, V(9.61812918116399292e-3));
    p = lane_fma(p, r, V(5.55041086684157248e-2));
    p = lane_fma(p, r, V(0.240226506957228187));
    p = lane_fma(p, r, V(0.693147180559885164));
    p = lane_fma(p, r, V(1.0));
    Integers n, bits;
    static_assert(sizeof(Integers) == sizeof(V));
    std::memcpy(&n, &shifted, sizeof(V));
    std::memcpy(&bits, &p, sizeof(V));
    bits = bits + (n << 52);
    V result;
    std::memcpy(&result, &bits, sizeof(V));
    return result;
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
