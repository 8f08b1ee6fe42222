#pragma once

#include "ops/kernels/simd/mat3.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// J is clamped here below where a logarithm or a root is taken, so that an inverted F has a
/// finite stress; the derivative with respect to J is zero below the clamp. Part of the definition
/// of newtonian (UniPhy, CVPR 2025), kept by the other laws of J.
inline constexpr double kMinimumJ = 1e-6;

/// max(det F, floor). A determinant that is not finite gives NaN: without the difference, −∞ would
/// come out as the floor and a blown-up state as a sound one.
template <class V>
UNIPHY_INLINE V clamped_volume(const V& det, const V& floor) {
  return lane_max(floor, det) + (det - det);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
