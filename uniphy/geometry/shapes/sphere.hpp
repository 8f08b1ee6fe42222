#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Sphere with its centre at the origin. Exact.
class Sphere final : public SignedDistance {
 public:
  explicit Sphere(double radius = 0.5);  ///< m
  double distance(const Eigen::Vector3d& p) const override { return p.norm() - radius_; }
  Bounds bounds() const override;
  double volume() const override;

 private:
  double radius_;
};

}  // namespace uniphy
