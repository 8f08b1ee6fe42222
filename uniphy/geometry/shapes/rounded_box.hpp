#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Box with edges and corners rounded off, centre at the origin: all points within `radius` of the
/// box of sides `sides` − 2 `radius`. Exact.
class RoundedBox final : public SignedDistance {
 public:
  /// Outer sides and the rounding radius, m; 0 < radius < half the shortest side.
  explicit RoundedBox(const Eigen::Vector3d& sides = {1, 1, 1}, double radius = 0.15);
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override { return {-half_, half_}; }
  /// abc + 2r(ab + bc + ca) + πr²(a + b + c) + 4πr³/3 with the inner sides a, b, c (Steiner).
  double volume() const override;

 private:
  Eigen::Vector3d half_;
  double radius_;
};

}  // namespace uniphy
