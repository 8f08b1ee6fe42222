#pragma once

#include "ops/kernels/simd/lanes.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// How much of an excess stays where it flows off at a rate that is a power of it: the share x in
/// (0, 1] with x + A x^p = 1.
template <class V>
struct PowerFlow {
  V share, log_share;
  V slope;  ///< x/(x + p (1 − x)): d(x e)/de of an excess e, where A goes as e^{p−1}
};

/// With w = log x: log(e^w + A e^{pw}) = 0, a convex, increasing function of w, for which Newton's
/// method converges from above without a step too far. It starts less than log 2 above; convergence
/// is quadratic, and for p from 0.1 to 10 seven steps reach the rounding of float64.
template <class V>
UNIPHY_INLINE PowerFlow<V> power_flow(const V& p, const V& log_A) {
  using T = ScalarOf<V>;
  constexpr int kSteps = 7;
  const V zero(T(0)), one(T(1));
  V w = lane_min(zero, -log_A / p);
  for (int i = 0; i < kSteps; ++i) {
    const V a = lane_exp(w), b = lane_exp(lane_fma(p, w, log_A)), sum = a + b;
    w = lane_min(zero, w - lane_log(sum) * sum / lane_fma(p, b, a));
  }
  PowerFlow<V> f;
  f.log_share = w;
  f.share = lane_exp(w);
  f.slope = f.share / lane_fma(p, one - f.share, f.share);
  return f;
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
