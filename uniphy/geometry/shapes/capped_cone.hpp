#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Frustum of a cone along y, flat ends at y = ±height/2. Exact: the signed distance to a trapezoid
/// in the half plane (r, y).
class CappedCone final : public SignedDistance {
 public:
  /// m; one of the radii may be 0.
  explicit CappedCone(double bottom_radius = 0.4, double top_radius = 0.15, double height = 1);
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override;
  double volume() const override;  ///< π h (R² + R r + r²)/3

 private:
  double bottom_, top_, half_height_;
};

}  // namespace uniphy
