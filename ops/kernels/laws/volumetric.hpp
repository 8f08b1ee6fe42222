#pragma once

#include "ops/kernels/laws/clamped_volume.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Projection of a solid that never yields: G(F) = F, bit for bit.
struct IdentityProjection {
  template <class V>
  static UNIPHY_INLINE Mat3<V> project(const Mat3<V>& F) {
    return F;
  }
  template <class V>
  static UNIPHY_INLINE Mat3<V> adjoint(const Mat3<V>& /*F*/, const Mat3<V>& grad) {
    return grad;
  }
};

/// Projection of a fluid, which forgets all but its volume: G(F) = J^{1/3} I, J = max(det F, 1e-6).
struct VolumetricProjection {
  template <class V>
  static UNIPHY_INLINE Mat3<V> project(const Mat3<V>& F) {
    using T = ScalarOf<V>;
    const V root = cbrt_positive(clamped_volume(determinant(F), V(T(kMinimumJ))));
    Mat3<V> r = zero3<V>();
    for (int i = 0; i < 3; ++i) r(i, i) = root;
    return r;
  }
  /// dL/dF = tr(dL/dG) ⅓ J^{−2/3} cof F, zero below the clamp.
  template <class V>
  static UNIPHY_INLINE Mat3<V> adjoint(const Mat3<V>& F, const Mat3<V>& grad) {
    using T = ScalarOf<V>;
    const V floor = V(T(kMinimumJ)), det = determinant(F), J = clamped_volume(det, floor);
    const V slope = trace(grad) * cbrt_positive(J) / (J * V(T(3)));
    return cofactor(F) * select<V>(det < floor, V(T(0)), slope);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
