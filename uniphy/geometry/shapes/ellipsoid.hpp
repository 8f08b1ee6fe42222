#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Ellipsoid (x/a)² + (y/b)² + (z/c)² ≤ 1. Exact (to 1e-9 of its size): the nearest surface point
/// is aᵢ² pᵢ/(t + aᵢ²), where t is the largest root of Σ (aᵢ pᵢ/(t + aᵢ²))² = 1 (D. Eberly,
/// "Distance from a Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid").
class Ellipsoid final : public SignedDistance {
 public:
  explicit Ellipsoid(const Eigen::Vector3d& radii = {0.5, 0.35, 0.25});  ///< m
  double distance(const Eigen::Vector3d& p) const override;
  bool inside(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override { return {-radii_, radii_}; }
  double volume() const override;

 private:
  Eigen::Vector3d radii_;
};

}  // namespace uniphy
