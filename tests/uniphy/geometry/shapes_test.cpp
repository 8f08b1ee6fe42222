// Known distances, closed volumes and refused parameters, shape by shape.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/geometry/shapes/blobby.hpp"
#include "uniphy/geometry/shapes/box.hpp"
#include "uniphy/geometry/shapes/capped_cone.hpp"
#include "uniphy/geometry/shapes/cylinder.hpp"
#include "uniphy/geometry/shapes/dodecahedron.hpp"
#include "uniphy/geometry/shapes/ellipsoid.hpp"
#include "uniphy/geometry/shapes/gear.hpp"
#include "uniphy/geometry/shapes/knurling.hpp"
#include "uniphy/geometry/shapes/octahedron.hpp"
#include "uniphy/geometry/shapes/pawn.hpp"
#include "uniphy/geometry/shapes/pyramid.hpp"
#include "uniphy/geometry/shapes/rounded_box.hpp"
#include "uniphy/geometry/shapes/rounded_cone.hpp"
#include "uniphy/geometry/shapes/sphere.hpp"
#include "uniphy/geometry/shapes/torus.hpp"
#include "uniphy/geometry/shapes/toy.hpp"
#include "uniphy/geometry/shapes/trapezoid.hpp"
#include "uniphy/geometry/smooth_union.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

constexpr double kTight = 1e-12;

TEST(Box, KnownDistances) {
  const Box box({1, 2, 3});
  EXPECT_NEAR(box.distance({0, 0, 0}), -0.5, kTight);
  EXPECT_NEAR(box.distance({0.5, 0.2, 0.1}), 0, kTight);
  EXPECT_NEAR(box.distance({1.5, 0, 0}), 1, kTight);
  EXPECT_NEAR(box.distance({0.5 + 3, 1 + 4, 0}), 5, kTight);
  EXPECT_NEAR(box.volume(), 6, kTight);
}

TEST(RoundedBox, KnownDistances) {
  const RoundedBox box({1, 1, 1}, 0.2);
  EXPECT_NEAR(box.distance({0, 0, 0}), -0.5, kTight);
  EXPECT_NEAR(box.distance({0, 0.5, 0}), 0, kTight);
  // The corner lies sqrt(3) * 0.2 from the centre of its rounding.
  EXPECT_NEAR(box.distance({0.5, 0.5, 0.5}), 0.2 * (std::sqrt(3.0) - 1), kTight);
  EXPECT_NEAR(box.distance({0.5, 0.5, 0}), 0.2 * (std::sqrt(2.0) - 1), kTight);
}

TEST(RoundedBox, VolumeOfTheLimitIsABall) {
  const double r = 0.5 - 1e-9;
  EXPECT_NEAR(RoundedBox({1, 1, 1}, r).volume(), M_PI / 6, 1e-8);
}

TEST(Ellipsoid, KnownDistances) {
  const Ellipsoid ellipsoid({0.5, 0.35, 0.25});
  EXPECT_NEAR(ellipsoid.distance({0, 0, 0}), -0.25, 1e-9);
  EXPECT_NEAR(ellipsoid.distance({1, 0, 0}), 0.5, 1e-9);
  EXPECT_NEAR(ellipsoid.distance({0, 0.35, 0}), 0, 1e-9);
  EXPECT_NEAR(ellipsoid.distance({0, 0, -1.25}), 1, 1e-9);
  // A ball has distances of its own.
  const Ellipsoid ball({0.4, 0.4, 0.4});
  EXPECT_NEAR(ball.distance({0.3, -0.2, 0.1}), std::sqrt(0.14) - 0.4, 1e-9);
}

TEST(Ellipsoid, AgreesWithADenseSearchOfTheSurface) {
  const Vector3d radii(0.5, 0.2, 0.1);
  const Ellipsoid ellipsoid(radii);
  for (const Vector3d& p : {Vector3d(0.1, 0.02, 0.01), Vector3d(0.6, 0.3, -0.2),
                            Vector3d(0.3, 0, 0), Vector3d(-0.45, 0.05, 0.0)}) {
    double nearest = 1e9;
    for (int i = 0; i <= 2000; ++i) {
      for (int j = 0; j < 2000; ++j) {
        const double polar = M_PI * i / 2000, round = 2 * M_PI * j / 2000;
        const Vector3d q = radii.cwiseProduct(Vector3d(
            std::sin(polar) * std::cos(round), std::sin(polar) * std::sin(round), std::cos(polar)));
        nearest = std::min(nearest, (p - q).norm());
      }
    }
    EXPECT_NEAR(std::abs(ellipsoid.distance(p)), nearest, 1e-5) << p.transpose();
  }
}

TEST(Torus, KnownDistances) {
  const Torus torus(0.35, 0.15);
  EXPECT_NEAR(torus.distance({0, 0, 0}), 0.2, kTight);
  EXPECT_NEAR(torus.distance({0.35, 0, 0}), -0.15, kTight);
  EXPECT_NEAR(torus.distance({0, 0.15, -0.35}), 0, kTight);
}

TEST(Cylinder, KnownDistances) {
  const Cylinder cylinder(0.3, 1);
  EXPECT_NEAR(cylinder.distance({0, 0, 0}), -0.3, kTight);
  EXPECT_NEAR(cylinder.distance({0, 0.4, 0}), -0.1, kTight);
  EXPECT_NEAR(cylinder.distance({0.3 + 0.03, 0.5 + 0.04, 0}), 0.05, kTight);
}

TEST(CappedCone, IsACylinderWhereTheRadiiAgree) {
  const CappedCone cone(0.3, 0.3, 1);
  const Cylinder cylinder(0.3, 1);
  for (const Vector3d& p : {Vector3d(0, 0, 0), Vector3d(0.1, 0.45, 0.05), Vector3d(0.5, 0.1, 0),
                            Vector3d(0.2, -0.9, 0.4)}) {
    EXPECT_NEAR(cone.distance(p), cylinder.distance(p), kTight) << p.transpose();
  }
  EXPECT_NEAR(cone.volume(), cylinder.volume(), kTight);
}

TEST(CappedCone, KnownDistances) {
  const CappedCone cone(3, 0, 4);  // apex at y = 2; the side has length 5
  EXPECT_NEAR(cone.distance({0, 2, 0}), 0, kTight);
  EXPECT_NEAR(cone.distance({0, 3, 0}), 1, kTight);
  EXPECT_NEAR(cone.distance({1.5, 0, 0}), 0, kTight);
  EXPECT_NEAR(cone.distance({0, 0, 0}), -1.2, kTight);  // 1.5 * 4/5
  EXPECT_NEAR(cone.volume(), 12 * M_PI, 1e-9);
}

TEST(RoundedCone, IsACapsuleWhereTheRadiiAgree) {
  const RoundedCone capsule(0.2, 0.2, 0.6);
  EXPECT_NEAR(capsule.distance({0.5, 0.3, 0}), 0.3, kTight);
  EXPECT_NEAR(capsule.distance({0, -0.5, 0}), 0.3, kTight);
  EXPECT_NEAR(capsule.distance({0, 0.8, 0}), 0, kTight);
  EXPECT_NEAR(capsule.volume(), M_PI * 0.04 * 0.6 + 4 * M_PI / 3 * 0.008, kTight);
}

TEST(Pyramid, KnownDistancesAndVolume) {
  const Pyramid pyramid(1, 0.8);
  EXPECT_NEAR(pyramid.distance({0, 0.6, 0}), 0, kTight);
  EXPECT_NEAR(pyramid.distance({0, -0.5, 0}), 0.3, kTight);
  EXPECT_NEAR(pyramid.distance({0, 1.6, 0}), 1, kTight);
  EXPECT_NEAR(pyramid.volume(), 0.8 / 3, kTight);
}

TEST(Octahedron, KnownDistancesAndVolume) {
  const Octahedron octahedron(0.6);
  EXPECT_NEAR(octahedron.distance({0, 0, 0}), -0.6 / std::sqrt(3.0), kTight);
  EXPECT_NEAR(octahedron.distance({0.2, 0.2, 0.2}), 0, kTight);
  EXPECT_NEAR(octahedron.distance({1.6, 0, 0}), 1, kTight);
  EXPECT_NEAR(octahedron.volume(), 4.0 / 3 * 0.216, kTight);
}

TEST(Dodecahedron, KnownDistancesAndVolume) {
  const double radius = 0.5;
  const double edge = 4 * radius / (std::sqrt(3.0) * (1 + std::sqrt(5.0)));
  const Dodecahedron dodecahedron(radius);
  const double inradius = edge / 2 * std::sqrt(2.5 + 1.1 * std::sqrt(5.0));
  EXPECT_NEAR(dodecahedron.distance({0, 0, 0}), -inradius, kTight);
  const Vector3d corner = radius / std::sqrt(3.0) * Vector3d(1, 1, 1);
  EXPECT_NEAR(dodecahedron.distance(corner), 0, kTight);
  EXPECT_NEAR(dodecahedron.distance(3 * corner), 2 * radius, kTight);
  EXPECT_NEAR(dodecahedron.volume(), (15 + 7 * std::sqrt(5.0)) / 4 * edge * edge * edge, kTight);
}

TEST(Blobby, OneBallIsASphere) {
  const Blobby ball(1, 0.3, 0.05, 3);
  EXPECT_NEAR(ball.distance({1, 0, 0}), 0.7, kTight);
  EXPECT_NEAR(ball.volume(), 4 * M_PI / 3 * 0.027, 1e-4);
}

TEST(Knurling, GroovesReachTheirDepth) {
  const Knurling knurling(0.35, 1, 0.06, 10, 0.6);
  EXPECT_FALSE(knurling.inside({0.3499, 0, 0}));  // angle 0, height 0: both grooves
  EXPECT_TRUE(knurling.inside({0.2899, 0, 0}));   // radius − depth
  const double ridge = M_PI / 10;                 // half a pitch on: both ridges
  EXPECT_TRUE(knurling.inside({0.3499 * std::cos(ridge), 0, 0.3499 * std::sin(ridge)}));
  EXPECT_FALSE(knurling.inside({0.3501 * std::cos(ridge), 0, 0.3501 * std::sin(ridge)}));
}

TEST(Gear, TeethGapsAndBore) {
  const Gear gear(0.5, 0.38, 0.14, 0.3, 10);
  EXPECT_TRUE(gear.inside({0.49, 0, 0}));  // a tooth points along x
  const double gap = M_PI / 10;
  EXPECT_FALSE(gear.inside({0.45 * std::cos(gap), 0, 0.45 * std::sin(gap)}));
  EXPECT_TRUE(gear.inside({0.37 * std::cos(gap), 0, 0.37 * std::sin(gap)}));
  EXPECT_FALSE(gear.inside({0, 0, 0}));
  EXPECT_NEAR(gear.distance({0, 0, 0}), 0.14, kTight);
  EXPECT_NEAR(gear.distance({0.25, 1.15, 0}), 1, kTight);
  EXPECT_TRUE(Gear(0.5, 0.38, 0, 0.3, 10).inside({0, 0, 0}));
}

TEST(Toy, IsSymmetricAndStands) {
  const Toy toy;
  for (const Vector3d& p : {Vector3d(0.2, 0.3, 0.1), Vector3d(0.35, 0.4, 0.2)}) {
    EXPECT_EQ(toy.distance(p), toy.distance({-p[0], p[1], p[2]}));
  }
  EXPECT_TRUE(toy.inside({0, 0.75, 0}));      // head
  EXPECT_TRUE(toy.inside({0.2, 0.08, 0.1}));  // foot
  EXPECT_FALSE(toy.inside({0, 0.05, 0}));     // between the legs
}

TEST(Pawn, HeadAboveANeck) {
  const Pawn pawn;
  EXPECT_TRUE(pawn.inside({0.15, 0.85, 0}));
  EXPECT_FALSE(pawn.inside({0.15, 0.55, 0}));
  EXPECT_TRUE(pawn.inside({0.28, 0.07, 0}));
  EXPECT_EQ(pawn.distance({0.3, 0.4, 0}), pawn.distance({0, 0.4, 0.3}));
}

TEST(Trapezoid, KnownDistances) {
  EXPECT_NEAR(trapezoid_distance(0, 0, 1, 1, 2), -1, kTight);
  EXPECT_NEAR(trapezoid_distance(-4, 6, 1, 1, 2), 5, kTight);
  EXPECT_NEAR(trapezoid_distance(0, 5, 3, 0, 2), 3, kTight);
}

TEST(SmoothUnion, MeetsThePlainUnionAwayFromTheSeam) {
  EXPECT_EQ(smooth_union(0.3, 0.9, 0.1), 0.3);
  EXPECT_NEAR(smooth_union(0.3, 0.3, 0.1), 0.3 - 0.025, kTight);
  EXPECT_EQ(smooth_union(0.3, 0.3, 0), 0.3);
}

TEST(ShapeCatalogue, RefusesUnknownNames) {
  try {
    make_shape("teapot");
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("knurling"),
                                             testing::HasSubstr("found \"teapot\"")));
  }
}

struct BadShape {
  const char* name;
  std::function<void()> make;
  const char* message;
};

class RefusedShape : public testing::TestWithParam<BadShape> {};

TEST_P(RefusedShape, SaysWhichParameter) {
  try {
    GetParam().make();
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(GetParam().message));
  }
}

const double kNan = std::nan("");

INSTANTIATE_TEST_SUITE_P(
    Shapes, RefusedShape,
    testing::Values(
        BadShape{"box",
                 [] {
                   Box({1, 0, 1});
                 },
                 "box.sides: expected a positive number, found 0"},
        BadShape{"box_nan",
                 [] {
                   Box({1, kNan, 1});
                 },
                 "box.sides: expected a positive number"},
        BadShape{"rounded_box",
                 [] {
                   RoundedBox({1, 1, 1}, 0.5);
                 },
                 "rounded_box.radius: expected more than 0 and less than half the shortest side"},
        BadShape{"sphere", [] { Sphere(-1); }, "sphere.radius"},
        BadShape{"ellipsoid",
                 [] {
                   Ellipsoid({1, 1, -1});
                 },
                 "ellipsoid.radii"},
        BadShape{"torus", [] { Torus(0.2, 0.3); }, "torus.minor: expected more than 0 and less"},
        BadShape{"cylinder", [] { Cylinder(0.1, 0); }, "cylinder.height"},
        BadShape{"capped_cone", [] { CappedCone(0, 0, 1); }, "capped_cone.bottom_radius + top"},
        BadShape{"rounded_cone", [] { RoundedCone(0.5, 0.1, 0.4); }, "rounded_cone.spacing"},
        BadShape{"pyramid", [] { Pyramid(1, -1); }, "pyramid.height"},
        BadShape{"octahedron", [] { Octahedron(0); }, "octahedron.radius"},
        BadShape{"dodecahedron", [] { Dodecahedron{kNan}; }, "dodecahedron.radius"},
        BadShape{"blobby", [] { Blobby(0); }, "blobby.count: expected a number from 1 to 1000"},
        BadShape{"knurling", [] { Knurling(0.3, 1, 0.1); }, "knurling.depth"},
        BadShape{"gear", [] { Gear(0.5, 0.6); }, "gear.root_radius"},
        BadShape{"gear_bore", [] { Gear(0.5, 0.4, 0.4); }, "gear.bore_radius"},
        BadShape{"pawn", [] { Pawn(-0.1); }, "pawn.fillet"},
        BadShape{"toy", [] { Toy(1); }, "toy.fillet"}),
    [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace uniphy
