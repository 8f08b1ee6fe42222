#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Spur gear round the y axis, centre at the origin: a disc with trapezoidal teeth and a bore.
/// Exact outside the bore as far as the teeth are the nearest part; inside and in the bore a bound
/// (union and difference of exact parts).
class Gear final : public SignedDistance {
 public:
  /// Radii of the tips, of the tooth roots and of the bore (0: none), thickness, m;
  /// bore < root < tip. `teeth` from 3 to 200.
  explicit Gear(double tip_radius = 0.5, double root_radius = 0.38, double bore_radius = 0.14,
                double thickness = 0.3, int teeth = 10);
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override { return bounds_; }

 private:
  double profile(double x, double z) const;  ///< signed distance in the plane of the disc

  double root_, bore_, half_thickness_;
  double tooth_centre_, tooth_half_height_, foot_, tip_;  ///< the tooth's trapezoid
  int teeth_;
  Bounds bounds_;
};

}  // namespace uniphy
