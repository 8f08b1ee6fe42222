#pragma once

#include "ops/kernels/spectral/spectral.hpp"

// Strain measures between Hencky's and the others, one smooth family:
//   m(x; γ, δ) = x exp(δ x) sinh(γ x)/(γ x) = (exp((δ+γ)x) − exp((δ−γ)x))/(2γ),   m(x; 0, 0) = x.
//   γ = δ = n/2: (exp(n ε) − 1)/n, the Seth–Hill measure of a principal strain ε; n = 0 is
//   Hencky's, n = 2 Green's (twice), whose stress is neo-Hookean. (B. R. Seth, 1964; R. Hill, J.
//   Mech. Phys. Solids 16, 1968.) x = tr ε: an equation of state; γ = 7/2, δ = −5/2 is (J − J⁻⁶)/7,
//   that of a liquid.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// sinh(y)/y and its derivative, to rounding at any y.
template <class V>
struct Sinhc {
  V value, slope;
};
template <class V>
UNIPHY_INLINE Sinhc<V> sinhc(const V& y) {
  using T = ScalarOf<V>;
  const V one(T(1)), half(T(0.5)), y2 = y * y;
  // Terms of 1/(2k+1)! y^2k and of 2k/(2k+1)! y^(2k−1), which reach 1e-16 below |y| = ½.
  V value(T(1.0 / 1307674368000)), slope(T(14.0 / 1307674368000));
  constexpr double kFactorial[6] = {6227020800, 39916800, 362880, 5040, 120, 6};
  for (int k = 0; k < 6; ++k) {
    value = lane_fma(value, y2, V(T(1.0 / kFactorial[k])));
    slope = lane_fma(slope, y2, V(T((12.0 - 2 * k) / kFactorial[k])));
  }
  value = lane_fma(value, y2, one);
  slope = slope * y;
  const auto near = lane_abs(y) < half;
  const V up = lane_exp(y), down = one / up, inverse = one / select<V>(near, one, y);
  const V far = half * (up - down) * inverse;
  return {select<V>(near, value, far),
          select<V>(near, slope, (half * (up + down) - far) * inverse)};
}

/// m(x; γ, δ) and its derivatives.
template <class V>
struct StrainMeasure {
  V value, slope, per_gamma, per_delta;
};
template <class V>
UNIPHY_INLINE StrainMeasure<V> strain_measure(const V& x, const V& gamma, const V& delta) {
  using T = ScalarOf<V>;
  const V limit = V(T(kArgumentLimit)), zero(T(0));
  const V y = gamma * x, d = delta * x;
  const Sinhc<V> s = sinhc(lane_max(lane_min(y, limit), -limit));
  const V factor = lane_exp(lane_max(lane_min(d, limit), -limit));
  const V ratio = factor * s.value;
  StrainMeasure<V> m;
  m.value = x * ratio;
  const V of_y = select<V>(lane_abs(y) < limit, x * factor * s.slope, zero);
  const V of_d = select<V>(lane_abs(d) < limit, m.value, zero);
  m.slope = lane_fma(of_y, gamma, lane_fma(of_d, delta, ratio));
  m.per_gamma = of_y * x;
  m.per_delta = of_d * x;
  return m;
}

/// (m(a) − m(b))/(a − b) of the Seth–Hill measure γ = δ = n/2.
template <class V>
UNIPHY_INLINE V seth_hill_divided_difference(const V& a, const V& b, const V& n) {
  using T = ScalarOf<V>;
  const V limit = V(T(2 * kArgumentLimit));
  const V x = lane_max(lane_min(n * a, limit), -limit),
          y = lane_max(lane_min(n * b, limit), -limit);
  return exp_divided_difference(x, y, lane_exp(x), lane_exp(y));
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
