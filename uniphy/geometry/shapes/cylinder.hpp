#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Cylinder along y, centre at the origin. Exact.
class Cylinder final : public SignedDistance {
 public:
  explicit Cylinder(double radius = 0.35, double height = 1);  ///< m
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override;
  double volume() const override;  ///< π r² h

 private:
  double radius_, half_height_;
};

}  // namespace uniphy
