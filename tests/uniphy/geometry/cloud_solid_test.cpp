#include "uniphy/geometry/cloud_solid.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <vector>

#include "uniphy/geometry/fill.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

/// A lattice of n³ particles in a box of side 0.4 round (0.5, 0.5, 0.5), turned by an angle.
CloudSolid box_cloud(int n, double angle) {
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(angle, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  std::vector<Vector3d> x;
  for (int p = 0; p < n * n * n; ++p) {
    const Vector3d i(p / n / n, p / n % n, p % n);
    x.push_back(Vector3d::Constant(0.5) + R * (0.4 * ((i.array() + 0.5) / n - 0.5)).matrix());
  }
  return {x, std::vector<double>(x.size(), 0.064 / (n * n * n))};
}

TEST(CloudSolid, ASideLiesHalfASpacingBeyondTheParticles) {
  for (const double angle : {0.0, 0.7}) {
    const CloudSolid cloud = box_cloud(10, angle);
    EXPECT_NEAR(cloud.volume(), 0.064, 1e-12);
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(angle, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    // Along the normal of a side, through places within it.
    for (const double y : {-0.08, 0.0, 0.051}) {
      const auto inside = [&](double r) {
        return cloud.inside(Vector3d::Constant(0.5) + R * Vector3d(r, y, 0.03));
      };
      for (double r = 0; r < 0.19; r += 0.005) EXPECT_TRUE(inside(r)) << r;
      EXPECT_FALSE(inside(0.21));
    }
  }
}

TEST(CloudSolid, IsFilledWithAsMuchAsThereWas) {
  const CloudSolid cloud = box_cloud(10, 0);
  // Particles of a lattice twice as fine: 20³ but for rounded edges.
  const auto x = fill_lattice_spacing(cloud, 0.02);
  EXPECT_LE(x.size(), 8000u);
  EXPECT_GE(x.size(), 7400u);
}

}  // namespace
}  // namespace uniphy
