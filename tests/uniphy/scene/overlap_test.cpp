#include "uniphy/scene/overlap.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <filesystem>

#include "ops/kernels/base/error.hpp"
#include "uniphy/config/config.hpp"
#include "uniphy/geometry/fill.hpp"
#include "uniphy/geometry/shapes/box.hpp"
#include "uniphy/geometry/shapes/sphere.hpp"
#include "uniphy/geometry/shapes/torus.hpp"
#include "uniphy/geometry/winding_number.hpp"
#include "uniphy/scene/scene.hpp"
#include "uniphy/scene/scene_config.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using testing::AllOf;
using testing::HasSubstr;

const SolidPtr kBox = std::make_shared<Box>(Vector3d(1, 1, 1));
const SolidPtr kBall = std::make_shared<Sphere>(0.5);

Filling lattice(std::int64_t particles) { return {Filling::Kind::lattice, particles, 0, 0}; }
Filling random_points(std::uint64_t seed) { return {Filling::Kind::random, 1000, 0, seed}; }

BodyDescription body(const char* name, const SolidPtr& solid, const Vector3d& centre, double size,
                     const Filling& filling) {
  BodyDescription b;
  b.name = name;
  b.solid = solid;
  b.placement.centre = centre;
  b.placement.size = size;
  b.filling = filling;
  return b;
}

/// The particles of `b` as a cloud, where b has them.
BodyDescription as_cloud(const BodyDescription& b, bool in_place = false) {
  const BodyParticles particles = place_body(b);
  BodyDescription cloud = b;
  cloud.solid = nullptr;
  cloud.placement.size = 0;
  cloud.placement.centre = bounds_of(particles.x).centre();
  cloud.placement.rotation.setIdentity();
  cloud.in_place = in_place;
  cloud.cloud = std::make_shared<ParticleCloud>(ParticleCloud{particles.x, particles.volume});
  return cloud;
}

/// What check_overlap says, in either order of the two bodies; empty where nothing.
std::string overlap(const BodyDescription& a, const BodyDescription& b) {
  std::string found[2];
  for (const bool swapped : {false, true}) {
    const std::vector<BodyDescription> bodies =
        swapped ? std::vector<BodyDescription>{b, a} : std::vector<BodyDescription>{a, b};
    try {
      check_overlap(bodies, {place_body(bodies[0]), place_body(bodies[1])});
    } catch (const Error& error) {
      found[swapped] = error.what();
    }
  }
  EXPECT_EQ(found[0].empty(), found[1].empty());
  return found[0];
}

TEST(Overlap, NamesBothBodiesAndThePlace) {
  const Filling one{Filling::Kind::per_side, 1, 0, 0};
  const std::string found = overlap(body("lump", kBox, {0.5, 0.5, 0.5}, 0.3, lattice(1000)),
                                    body("pill", kBall, {0.4, 0.52, 0.6}, 0.1, one));
  EXPECT_EQ(found,
            "bodies \"lump\" and \"pill\" overlap: expected bodies apart from each other or just "
            "touching, found a particle of \"lump\" at (0.365, 0.485, 0.605) m inside \"pill\"");
}

TEST(Overlap, FindsAFineBodyBetweenTheParticlesOfACoarseOne) {
  // The small ball holds none of the 27 particles of the box: its own lie inside the box.
  EXPECT_THAT(overlap(body("coarse", kBox, {0.5, 0.5, 0.5}, 0.6, lattice(27)),
                      body("fine", kBall, {0.6, 0.6, 0.6}, 0.1, lattice(500))),
              HasSubstr("a particle of \"fine\""));
}

TEST(Overlap, LetsBodiesTouch) {
  const Vector3d left(0.35, 0.5, 0.5), right(0.65, 0.5, 0.5);
  for (int seed = 1; seed <= 20; ++seed) {
    const auto a = body("a", kBox, left, 0.3, random_points(seed));
    const auto b = body("b", kBox, right, 0.3, random_points(100 + seed));
    EXPECT_EQ(overlap(a, b), "");
    EXPECT_EQ(overlap(as_cloud(a), as_cloud(b)), "") << seed;
    EXPECT_EQ(overlap(as_cloud(a), b), "");
  }
  const auto a = body("a", kBox, left, 0.3, lattice(1000));
  for (const std::int64_t particles : {64, 1000, 8000}) {
    const auto b = body("b", kBox, right, 0.3, lattice(particles));
    EXPECT_EQ(overlap(a, b), "");
    EXPECT_EQ(overlap(as_cloud(a), as_cloud(b)), "") << particles;
  }
  // A ball on a table, and a ball in the hole of a ring.
  const auto ball = body("ball", kBall, {0.5, 0.5, 0.5}, 0.2, lattice(2000));
  const auto table = body("table", kBox, {0.5, 0.3, 0.5}, 0.2, lattice(2000));
  EXPECT_EQ(overlap(ball, table), "");
  const auto ring = std::make_shared<Torus>(0.4, 0.1);
  EXPECT_EQ(overlap(ball, body("ring", ring, {0.5, 0.5, 0.5}, 0.4, lattice(2000))), "");
}

TEST(Overlap, RefusesSolidsThatShareSpace) {
  const auto a = body("a", kBox, {0.35, 0.5, 0.5}, 0.3, lattice(1000));
  auto b = body("b", kBox, {0.63, 0.5, 0.5}, 0.3, lattice(1000));
  EXPECT_THAT(overlap(a, b), HasSubstr("overlap"));
  b.placement.centre[0] = 0.67;
  EXPECT_EQ(overlap(a, b), "");
  // Turned, an edge reaches into the neighbour.
  b.placement.rotation = euler_rotation({0, 0, 45});
  EXPECT_THAT(overlap(a, b), HasSubstr("overlap"));
}

TEST(Overlap, SeesMeshes) {
  std::filesystem::current_path(UNIPHY_SOURCE_DIR);
  const auto star =
      std::make_shared<MeshSolid>(close_surface(read_obj("configs/simulate/star.obj")));
  const auto big = body("star", star, {0.5, 0.5, 0.5}, 0.4, lattice(500));
  EXPECT_THAT(overlap(big, body("ball", kBall, {0.5, 0.5, 0.5}, 0.05, lattice(100))),
              HasSubstr("overlap"));
  EXPECT_EQ(overlap(big, body("ball", kBall, {0.8, 0.5, 0.5}, 0.05, lattice(100))), "");
}

TEST(Overlap, SeesClouds) {
  const auto solid = body("solid", kBox, {0.5, 0.5, 0.5}, 0.3, lattice(1000));
  const auto cloud = as_cloud(solid);
  for (const double shift : {0.0, 0.015, 0.1, 0.22}) {  // 0, ½, 3⅓, 7⅓ spacings
    auto other = cloud;
    other.name = "other";
    other.placement.centre += Vector3d(shift, shift / 2, 0);
    EXPECT_THAT(overlap(cloud, other), AllOf(HasSubstr("solid"), HasSubstr("other"))) << shift;
    EXPECT_THAT(overlap(solid, other), HasSubstr("overlap")) << shift;
  }
  auto apart = cloud;
  apart.placement.centre[0] += 0.3;
  EXPECT_EQ(overlap(cloud, apart), "");
  const auto grains = as_cloud(body("grains", kBall, {0.5, 0.5, 0.5}, 0.04, lattice(8)));
  EXPECT_THAT(overlap(cloud, grains), HasSubstr("a particle of \"grains\""));
}

TEST(Overlap, LetsStatesOfEarlierRunsPressOnEachOther) {
  const auto a = body("a", kBox, {0.35, 0.5, 0.5}, 0.3, random_points(1));
  const auto b = body("b", kBox, {0.55, 0.5, 0.5}, 0.3, random_points(2));
  EXPECT_EQ(overlap(as_cloud(a, true), as_cloud(b, true)), "");
  auto again = as_cloud(a, true);
  again.name = "again";
  EXPECT_THAT(overlap(as_cloud(a, true), again), HasSubstr("overlap"));
}

TEST(Overlap, IsRefusedByScenes) {
  const Config config = Config::parse(
      "bodies: [{name: left, law: {type: water, lambda: 1e4}}, "
      "{name: right, center: [0.6, 0.5, 0.5], law: {type: water, lambda: 1e4}}]");
  Section root = config.root();
  const SceneSource source = read_scene(root);
  config.finish();
  try {
    place_scene(source.load());
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("bodies \"left\" and \"right\" overlap"));
  }
}

}  // namespace
}  // namespace uniphy
