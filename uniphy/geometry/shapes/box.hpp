#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Box with its centre at the origin. Exact.
class Box final : public SignedDistance {
 public:
  explicit Box(const Eigen::Vector3d& sides = {1, 1, 1});  ///< m
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override { return {-half_, half_}; }
  double volume() const override { return 8 * half_.prod(); }

 private:
  Eigen::Vector3d half_;
};

}  // namespace uniphy
