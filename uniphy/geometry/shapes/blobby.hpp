#pragma once

#include <cstdint>
#include <vector>

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// A lump: the smooth union −k log Σ exp(−dᵢ/k) of `count` spheres strewn round the origin. Each
/// sphere overlaps an earlier one, so the lump is in one piece. Bound (the log-sum-exp has a
/// gradient that is a convex combination of unit vectors, and lies at most k log count below the
/// smallest dᵢ).
class Blobby final : public SignedDistance {
 public:
  static constexpr int kCount = 6;
  static constexpr double kRadius = 0.24, kSmoothing = 0.06;

  /// Radii are drawn from [0.6, 1] · radius (m); `smoothing` = k (m); `seed` draws the lump.
  explicit Blobby(int count = kCount, double radius = kRadius, double smoothing = kSmoothing,
                  std::uint64_t seed = 1);
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override { return bounds_; }

 private:
  struct Ball {
    Eigen::Vector3d centre;
    double radius;
  };
  std::vector<Ball> balls_;
  double smoothing_;
  Bounds bounds_;
};

}  // namespace uniphy
