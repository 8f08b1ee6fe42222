#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Knurled cylinder along y, centre at the origin: two families of helical grooves leave a pattern
/// of diamonds. Bound: the radial distance is divided by the steepest slope of the pattern.
class Knurling final : public SignedDistance {
 public:
  /// Outer radius, height, depth of the grooves (m, depth < radius/4), number of grooves a turn in
  /// each family (≥ 3) and how far one groove turns over the height (turns).
  explicit Knurling(double radius = 0.35, double height = 1, double depth = 0.06, int grooves = 10,
                    double turns = 0.6);
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override;

 private:
  double radius_, half_height_, depth_;
  int grooves_;
  double twist_;  ///< phase of the pattern a metre of height, rad/m
  double slope_;  ///< largest |gradient| of the radial distance
};

}  // namespace uniphy
