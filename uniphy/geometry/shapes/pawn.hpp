#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Chess pawn that stands on the plane y = 0, turned round the y axis: a foot, a waisted body, a
/// collar and a ball for a head, joined by fillets in the half plane (r, y). One unit tall; scale
/// it by its size. Bound (smooth union of exact parts).
class Pawn final : public SignedDistance {
 public:
  /// `fillet`: width of the smooth union, in units of the height, at most 0.09; 0 gives a plain
  /// union.
  explicit Pawn(double fillet = 0.06);
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override { return {{-0.31, 0, -0.31}, {0.31, 1, 0.31}}; }

 private:
  double fillet_;
};

}  // namespace uniphy
