#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// A toy bear about one unit tall, feet near the plane y = 0, looking along +z: trunk, head with
/// ears and snout, two arms, two legs, joined by fillets. Bound (smooth union of exact parts).
class Toy final : public SignedDistance {
 public:
  /// `fillet`: width of the smooth union, in units of the height; 0 gives a plain union.
  explicit Toy(double fillet = 0.05);
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override { return bounds_; }

 private:
  double fillet_;
  Bounds bounds_;
};

}  // namespace uniphy
