#pragma once

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Torus round the y axis. Exact.
class Torus final : public SignedDistance {
 public:
  /// Radius of the ring's centre line and of the tube, m; minor < major.
  explicit Torus(double major = 0.35, double minor = 0.15);
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override;
  double volume() const override;  ///< 2π² R r²

 private:
  double major_, minor_;
};

}  // namespace uniphy
