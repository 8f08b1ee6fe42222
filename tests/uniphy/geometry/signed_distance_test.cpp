// Properties that every signed distance keeps, run over the whole catalogue.

#include "uniphy/geometry/signed_distance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "uniphy/geometry/random.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

// The shapes documented as exact; the others return a bound.
const std::set<std::string> kExact{"box",          "capped_cone", "cylinder", "dodecahedron",
                                   "ellipsoid",    "octahedron",  "pyramid",  "rounded_box",
                                   "rounded_cone", "sphere",      "torus"};

class EveryShape : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    shape_ = std::dynamic_pointer_cast<const SignedDistance>(make_shape(GetParam()));
    ASSERT_TRUE(shape_);
    bounds_ = shape_->bounds();
    const Vector3d margin = Vector3d::Constant(0.5 * bounds_.largest_side());
    low_ = bounds_.min - margin;
    high_ = bounds_.max + margin;
  }
  Vector3d gradient(const Vector3d& p, double h = 1e-6) const {
    Vector3d g;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d e = h * Vector3d::Unit(axis);
      g[axis] = (shape_->distance(p + e) - shape_->distance(p - e)) / (2 * h);
    }
    return g;
  }

  std::shared_ptr<const SignedDistance> shape_;
  Bounds bounds_;
  Vector3d low_, high_;
  UniformRandom random_{7};
};

TEST_P(EveryShape, ChangesNoFasterThanThePointMoves) {
  for (int trial = 0; trial < 20000; ++trial) {
    const Vector3d p = random_.in_box(low_, high_);
    const double step = std::pow(10.0, random_.between(-5, -0.5));
    const Vector3d q = p + step * random_.direction();
    const double change = std::abs(shape_->distance(p) - shape_->distance(q));
    ASSERT_LE(change, (q - p).norm() * (1 + 1e-9) + 1e-11)
        << p.transpose() << " | " << q.transpose();
  }
}

TEST_P(EveryShape, ExactOnesLeadToTheirSurfaceAlongTheGradient) {
  if (kExact.count(GetParam()) == 0) GTEST_SKIP() << "documented as a bound";
  int kinks = 0;
  const int trials = 5000;
  for (int trial = 0; trial < trials; ++trial) {
    const Vector3d p = random_.in_box(low_, high_);
    const Vector3d g = gradient(p);
    if (std::abs(g.norm() - 1) > 1e-6) {
      ++kinks;  // on the medial axis, within the step of the difference quotient
      continue;
    }
    ASSERT_NEAR(shape_->distance(p - shape_->distance(p) * g), 0, 1e-5) << p.transpose();
  }
  EXPECT_LE(kinks, trials / 200);
}

TEST_P(EveryShape, GradientNeverVanishesAtTheSurface) {
  // A bound that went flat at the surface would stop every search for it.
  int found = 0;
  for (int trial = 0; trial < 400000 && found < 300; ++trial) {
    Vector3d p = random_.in_box(bounds_.min, bounds_.max);
    if (std::abs(shape_->distance(p)) > 0.004 * bounds_.largest_side()) continue;
    ++found;
    ASSERT_GT(gradient(p).norm(), 0.3) << p.transpose();
  }
  EXPECT_EQ(found, 300);
}

TEST_P(EveryShape, InsideMeansNegativeAndWithinTheBounds) {
  int inside = 0;
  for (int trial = 0; trial < 50000; ++trial) {
    const Vector3d p = random_.in_box(low_, high_);
    const double d = shape_->distance(p);
    ASSERT_TRUE(std::isfinite(d));
    if (std::abs(d) > 1e-9) {
      ASSERT_EQ(shape_->inside(p), d < 0) << p.transpose();
    }
    if (d > 0) continue;
    ++inside;
    ASSERT_TRUE((p.array() >= bounds_.min.array()).all() &&
                (p.array() <= bounds_.max.array()).all())
        << p.transpose();
  }
  EXPECT_GT(inside, 500);
}

TEST_P(EveryShape, BoundsTouchTheShape) {
  const double size = bounds_.largest_side();
  EXPECT_GT(size, 0.5);
  EXPECT_LT(size, 2.0);
  const Vector3d margin = Vector3d::Constant(0.01 * size);
  const Bounds tight =
      tight_bounds(*shape_, {bounds_.min - margin, bounds_.max + margin}, 6e-3 * size);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(tight.min[axis], bounds_.min[axis], 6e-3 * size) << "axis " << axis;
    EXPECT_NEAR(tight.max[axis], bounds_.max[axis], 6e-3 * size) << "axis " << axis;
  }
}

TEST_P(EveryShape, VolumeIsTheShareOfRandomPointsInside) {
  const int trials = 400000;
  int inside = 0;
  for (int trial = 0; trial < trials; ++trial) {
    inside += shape_->inside(random_.in_box(bounds_.min, bounds_.max));
  }
  const double share = static_cast<double>(inside) / trials;
  const double expected = shape_->volume() / bounds_.sides().prod();
  const double deviation = std::sqrt(expected * (1 - expected) / trials);
  EXPECT_NEAR(share, expected, 4 * deviation + 2e-3 * expected);
}

TEST_P(EveryShape, OctreeVolumeAgreesWithTheVolume) {
  const double volume = shape_->volume();
  EXPECT_NEAR(octree_volume(*shape_, bounds_, 8), volume, 1e-3 * volume);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EveryShape, testing::ValuesIn(shape_names()),
                         [](const auto& info) { return info.param; });

TEST(OctreeVolume, ConvergesToTheSphere) {
  const auto sphere = std::dynamic_pointer_cast<const SignedDistance>(make_shape("sphere"));
  const double exact = M_PI / 6;
  double previous = std::abs(octree_volume(*sphere, sphere->bounds(), 4) - exact);
  for (int depth = 6; depth <= 8; depth += 2) {
    const double error = std::abs(octree_volume(*sphere, sphere->bounds(), depth) - exact);
    EXPECT_LT(error, 0.15 * previous) << depth;  // second order: 1/16 for two levels
    previous = error;
  }
}

TEST(Blobby, SeedsGiveDifferentLumpsInOnePiece) {
  const SolidPtr one = make_shape("blobby", 1), other = make_shape("blobby", 2);
  EXPECT_GT(std::abs(one->volume() - other->volume()), 1e-4);
  EXPECT_EQ(one->volume(), make_shape("blobby", 1)->volume());
}

}  // namespace
}  // namespace uniphy
