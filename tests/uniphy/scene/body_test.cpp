#include "uniphy/scene/body.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numeric>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/geometry/shapes/box.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

BodyDescription cube() {
  BodyDescription body;
  body.name = "cube";
  body.solid = std::make_shared<Box>(Vector3d(1, 1, 1));
  body.filling = {Filling::Kind::per_side, 4, 0, 0};
  body.placement.size = 0.4;
  return body;
}

std::string error_of(const BodyDescription& body) {
  try {
    place_body(body);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(PlaceBody, ScalesAndMoves) {
  BodyDescription body = cube();
  body.placement.centre = {0.3, 0.4, 0.5};
  const BodyParticles particles = place_body(body);
  ASSERT_EQ(particles.x.size(), 64u);
  EXPECT_LT((particles.x[0] - Vector3d(0.15, 0.25, 0.35)).norm(), 1e-14);
  EXPECT_LT((particles.x[63] - Vector3d(0.45, 0.55, 0.65)).norm(), 1e-14);
  EXPECT_LT((particles.x[1] - Vector3d(0.15, 0.25, 0.45)).norm(), 1e-14) << "z runs fastest";
}

TEST(PlaceBody, MassIsDensityTimesTheVolumeOfTheShape) {
  for (const std::string& shape : shape_names()) {
    BodyDescription body = cube();
    body.solid = make_shape(shape);
    body.filling = {Filling::Kind::lattice, 500, 0, 0};
    body.density = 700;
    const BodyParticles particles = place_body(body);
    const double scale = 0.4 / body.solid->bounds().largest_side();
    const double expected = body.solid->volume() * std::pow(scale, 3);
    EXPECT_NEAR(std::accumulate(particles.volume.begin(), particles.volume.end(), 0.0), expected,
                1e-12)
        << shape;
    EXPECT_NEAR(std::accumulate(particles.mass.begin(), particles.mass.end(), 0.0), 700 * expected,
                1e-9)
        << shape;
  }
}

TEST(PlaceBody, TurnsAboutItsCentre) {
  BodyDescription body = cube();
  body.solid = std::make_shared<Box>(Vector3d(1, 0.5, 0.25));
  body.placement.rotation = euler_rotation({0, 0, 90});
  const BodyParticles particles = place_body(body);
  Vector3d low = particles.x[0], high = low;
  for (const Vector3d& x : particles.x) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  // The long side now stands upright: 3/4 of 0.2, 0.4, 0.1 between the outermost cell centres
  // (2, 4 and 1 cells).
  EXPECT_LT((high - low - Vector3d(0.1, 0.3, 0)).norm(), 1e-12);
  EXPECT_LT((0.5 * (high + low) - Vector3d(0.5, 0.5, 0.5)).norm(), 1e-12);
}

TEST(PlaceBody, SpinsAboutItsCentre) {
  BodyDescription body = cube();
  body.velocity = {1, 2, 3};
  body.angular_velocity = {0, 0, 5};
  const BodyParticles particles = place_body(body);
  for (std::size_t p = 0; p < particles.x.size(); ++p) {
    const Vector3d r = particles.x[p] - Vector3d(0.5, 0.5, 0.5);
    const Vector3d expected = Vector3d(1, 2, 3) + 5 * Vector3d(-r[1], r[0], 0);
    ASSERT_LT((particles.v[p] - expected).norm(), 1e-13);
  }
}

TEST(PlaceBody, SpacingIsMeasuredAfterScaling) {
  BodyDescription body = cube();
  body.filling = {Filling::Kind::spacing, 0, 0.1, 0};
  EXPECT_EQ(place_body(body).x.size(), 64u);
}

TEST(PlaceBody, CloudsKeepTheirVolumesAndMayStayInPlace) {
  BodyDescription body;
  body.cloud = std::make_shared<ParticleCloud>(
      ParticleCloud{{Vector3d(0.2, 0.2, 0.2), Vector3d(0.4, 0.2, 0.2)}, {1e-6, 3e-6}});
  body.placement.size = 0.4;
  body.placement.centre = {0.5, 0.6, 0.7};
  const BodyParticles moved = place_body(body);
  EXPECT_LT((moved.x[0] - Vector3d(0.3, 0.6, 0.7)).norm(), 1e-14);
  EXPECT_NEAR(moved.volume[1], 8 * 3e-6, 1e-18);
  body.in_place = true;
  body.angular_velocity = {0, 1, 0};
  const BodyParticles kept = place_body(body);
  EXPECT_EQ(kept.x[1], Vector3d(0.4, 0.2, 0.2));
  EXPECT_EQ(kept.volume[1], 3e-6);
  EXPECT_LT((kept.v[1] - Vector3d(0, 0, -0.1)).norm(), 1e-14);
}

TEST(PlaceBody, NamesTheBodyInErrors) {
  BodyDescription body = cube();
  body.density = -1;
  EXPECT_THAT(error_of(body), HasSubstr("body \"cube\": density"));
  body = cube();
  body.solid = nullptr;
  EXPECT_THAT(error_of(body), HasSubstr("expected a shape or particles"));
  body.cloud = std::make_shared<ParticleCloud>(ParticleCloud{{Vector3d(0.5, 0.5, 0.5)}, {}});
  body.placement.size = 0;
  EXPECT_THAT(error_of(body), HasSubstr("particle_volume"));
  body.placement.size = 0.3;
  EXPECT_THAT(error_of(body), HasSubstr("all particles stand at one place"));
}

TEST(EulerRotation, TurnsAboutXThenYThenZ) {
  const Eigen::Matrix3d R = euler_rotation({90, 90, 0});
  EXPECT_LT((R * Vector3d(0, 1, 0) - Vector3d(1, 0, 0)).norm(), 1e-14);  // y → z → x
  const Eigen::Matrix3d any = euler_rotation({10, -70, 200});
  EXPECT_LT((any.transpose() * any - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_NEAR(any.determinant(), 1, 1e-14);
}

}  // namespace
}  // namespace uniphy
