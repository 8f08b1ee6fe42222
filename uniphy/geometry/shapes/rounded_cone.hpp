#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Convex hull of two spheres on the y axis, the lower one of radius `bottom_radius` round the
/// origin, the upper one of radius `top_radius` round (0, distance of centres, 0). Exact; with
/// equal radii it is a capsule.
class RoundedCone final : public SignedDistance {
 public:
  /// m; `spacing` is the distance of the centres, larger than the difference of the radii.
  explicit RoundedCone(double bottom_radius = 0.3, double top_radius = 0.15, double spacing = 0.55);
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override;
  /// The frustum between the circles of contact and the two spherical caps beyond them.
  double volume() const override;

 private:
  double bottom_, top_, spacing_;
  double slope_, run_;  ///< sine and cosine of the angle between the side and the axis
};

}  // namespace uniphy
