// Physics with closed answers, and what scenes refuse.

#include "uniphy/scene/scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "tests/uniphy/support/limits.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/geometry/shapes/box.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::HasSubstr;

BodyDescription ball(const Vector3d& centre, double size = 0.2) {
  BodyDescription body;
  body.name = "ball";
  body.solid = make_shape("sphere");
  body.filling = {Filling::Kind::lattice, 300, 0, 0};
  body.placement.centre = centre;
  body.placement.size = size;
  body.law.id = kernels::LawId::elastic;
  body.law.mu = 1e4;
  body.law.lambda = 2e4;
  return body;
}

SceneDescription one(const BodyDescription& body) {
  SceneDescription scene;
  scene.dt = 5e-4;
  scene.steps = 100;
  scene.frame_stride = 20;
  scene.bodies.push_back(body);
  return scene;
}

Vector3d row(const std::vector<double>& values, std::size_t p) {
  return {values[3 * p], values[3 * p + 1], values[3 * p + 2]};
}

std::string error_of(const SceneDescription& scene) {
  try {
    place_scene(scene);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(RunScene, FreeFallFollowsTheParabola) {
  BodyDescription body = ball({0.5, 0.7, 0.5});
  body.velocity = {1, 0.5, -1};
  const SceneDescription scene = one(body);
  const Trajectory trajectory = run_scene(scene);
  ASSERT_EQ(trajectory.frames, 6);
  for (std::int64_t frame = 0; frame < trajectory.frames; ++frame) {
    Vector3d centre = Vector3d::Zero();
    for (std::int64_t p = 0; p < trajectory.particles; ++p) {
      const double* x = trajectory.positions(frame) + 3 * p;
      centre += Vector3d(x[0], x[1], x[2]) / static_cast<double>(trajectory.particles);
    }
    const double t = trajectory.time[frame], dt = *scene.dt;
    // Velocities first, then positions: g t (t + Δt)/2.
    const Vector3d expected = Vector3d(0.5, 0.7, 0.5) + t * Vector3d(1, 0.5, -1) +
                              0.5 * t * (t + dt) * Vector3d(0, -9.8, 0);
    EXPECT_LT((centre - expected).norm(), 1e-12) << "frame " << frame;
    EXPECT_NEAR(t, 20 * dt * static_cast<double>(frame), 1e-15);
  }
}

TEST(RunScene, KeepsMomentumAndAngularMomentumInFreeFlight) {
  BodyDescription body = ball({0.5, 0.5, 0.5}, 0.4);
  body.velocity = {0.3, -0.2, 0.1};
  body.angular_velocity = {3, -5, 4};
  SceneDescription scene = one(body);
  scene.grid.gravity[1] = 0;
  const PlacedScene placed = place_scene(scene);
  const ParticleState last =
      run_scene(scene, placed, {}, [](double, std::int64_t, const ParticleState&) { return true; });
  // APIC: the angular momentum of the affine velocity, m Δx²/4 per unit of vorticity, counts too.
  const double inertia = 0.25 * placed.grid.dx() * placed.grid.dx();
  Vector3d momentum[2] = {Vector3d::Zero(), Vector3d::Zero()};
  Vector3d angular[2] = {Vector3d::Zero(), Vector3d::Zero()};
  for (std::ptrdiff_t p = 0; p < placed.particles(); ++p) {
    const double m = placed.mass[p];
    const Vector3d x[2] = {row(placed.x, p), row(last.x, p)};
    const Vector3d v[2] = {row(placed.v, p), row(last.v, p)};
    for (int k = 0; k < 2; ++k) {
      momentum[k] += m * v[k];
      angular[k] += m * (x[k] - Vector3d(0.5, 0.5, 0.5)).cross(v[k]);
    }
    const double* C = last.C.data() + 9 * p;
    angular[1] += m * inertia * Vector3d(C[7] - C[5], C[2] - C[6], C[3] - C[1]);
  }
  EXPECT_LT((momentum[1] - momentum[0]).norm(), 1e-12 * momentum[0].norm());
  EXPECT_LT((angular[1] - angular[0]).norm(), 1e-10 * angular[0].norm());
}

TEST(RunScene, BodiesThatNeverMeetMoveAsIfAlone) {
  BodyDescription left = ball({0.25, 0.3, 0.5}), right = ball({0.75, 0.3, 0.5});
  left.name = "left";
  right.law.id = kernels::LawId::newtonian;
  right.law.mu = 20;
  right.density = 500;
  left.velocity = right.velocity = {0, -3, 0};
  SceneDescription both = one(left), first = one(left), second = one(right);
  both.bodies.push_back(right);
  for (SceneDescription* scene : {&both, &first, &second}) {
    scene->grid.n = 40;
    scene->steps = 150;
  }
  const Trajectory together = run_scene(both);
  const Trajectory alone[2] = {run_scene(first), run_scene(second)};
  ASSERT_EQ(together.particles, alone[0].particles + alone[1].particles);
  for (std::int64_t p = 0; p < together.particles; ++p) {
    const int b = p < alone[0].particles ? 0 : 1;
    const std::int64_t own = b == 0 ? p : p - alone[0].particles;
    EXPECT_EQ(together.body[p], b);
    EXPECT_EQ(together.mass[p], alone[b].mass[own]);
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_NEAR(together.last.x[3 * p + axis], alone[b].last.x[3 * own + axis], 1e-12);
    }
  }
  // Both have hit the floor, each in its own way.
  EXPECT_GT(std::abs(alone[0].last.x[1] - alone[1].last.x[1]), 1e-4);
}

TEST(RunScene, StoresTheFieldsThatWereAskedFor) {
  SceneDescription scene = one(ball({0.5, 0.5, 0.5}));
  const Trajectory plain = run_scene(scene);
  EXPECT_TRUE(plain.v.empty() && plain.F.empty() && plain.C.empty());
  EXPECT_EQ(plain.last.F.size(), static_cast<std::size_t>(9 * plain.particles));
  FrameFields fields;
  fields.F = fields.v = true;
  const Trajectory full = run_scene(scene, fields, "yaml");
  EXPECT_EQ(full.v.size(), full.x.size());
  EXPECT_EQ(full.F.size(), 3 * full.x.size());
  EXPECT_TRUE(full.C.empty());
  EXPECT_EQ(full.scene, "yaml");
  EXPECT_EQ(full.x, plain.x);
}

TEST(RunScene, StopsWhenTheReceiverSaysSo) {
  const SceneDescription scene = one(ball({0.5, 0.5, 0.5}));
  int frames = 0;
  run_scene(scene, place_scene(scene), {},
            [&](double, std::int64_t, const ParticleState&) { return ++frames < 3; });
  EXPECT_EQ(frames, 3);
}

TEST(PlaceScene, DurationSetsTheSteps) {
  SceneDescription scene = one(ball({0.5, 0.5, 0.5}));
  scene.duration = 0.1;
  EXPECT_EQ(place_scene(scene).steps, 200);
  scene.duration = 0.1001;
  EXPECT_EQ(place_scene(scene).steps, 201);
}

TEST(PlaceScene, NamesTheBodyThatLeavesTheSpaceBetweenTheWalls) {
  EXPECT_THAT(error_of(one(ball({0.5, 0.17, 0.5}))),
              AllOf(HasSubstr("body \"ball\": spans y from 0.0"), HasSubstr("within 0.1 to 0.9")));
  EXPECT_THAT(error_of(one(ball({0.95, 0.5, 0.5}))), HasSubstr("spans x from 0.8"));
  EXPECT_THAT(error_of(one(ball({0.5, 0.5, 0.5}, 0.95))), HasSubstr("spans"));
  // The planes of the walls are the innermost nodes that they stop.
  for (int axis = 0; axis < 3; ++axis) {
    for (const double centre : {0.2, 0.8}) {
      Vector3d at(0.5, 0.5, 0.5);
      at[axis] = centre;
      EXPECT_EQ(error_of(one(ball(at))), "no error") << axis << " " << centre;
    }
  }
  SceneDescription thin = one(ball({0.5, 0.17, 0.5}));
  thin.grid.bound = 1;
  EXPECT_EQ(error_of(thin), "no error");
}

TEST(PlaceScene, PutsABodyOnTheFloor) {
  // A lattice whose surface is half a spacing beyond its particles: 0.2/8/2.
  BodyDescription body = ball({0.5, 0.6, 0.5});
  body.solid = make_shape("box");
  body.filling = {Filling::Kind::per_side, 8, 0, 0};
  body.on_floor = true;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      SceneDescription scene = one(body);
      std::fill(scene.grid.gravity, scene.grid.gravity + 3, 0.0);
      scene.grid.gravity[axis] = 9.8 * sign;
      const PlacedScene placed = place_scene(scene);
      double least = 1, most = 0;
      for (std::ptrdiff_t p = 0; p < placed.particles(); ++p) {
        least = std::min(least, placed.x[3 * p + axis]);
        most = std::max(most, placed.x[3 * p + axis]);
      }
      EXPECT_NEAR(sign < 0 ? least : most, sign < 0 ? 0.1 + 0.0125 : 0.9 - 0.0125, 1e-12) << axis;
    }
  }
  SceneDescription weightless = one(body);
  weightless.grid.gravity[1] = 0;
  EXPECT_THAT(error_of(weightless), HasSubstr("on_floor: expected gravity"));
}

TEST(RunScene, ABodyOnTheFloorStaysThereButForItsSag) {
  BodyDescription body = ball({0.5, 0.6, 0.5}, 0.3);
  body.solid = make_shape("box");
  body.filling = {Filling::Kind::per_side, 12, 0, 0};
  body.law.mu = 5e5;
  body.law.lambda = 5e5;
  body.on_floor = true;
  SceneDescription scene = one(body);
  scene.dt.reset();
  scene.duration = 0.3;
  const Trajectory trajectory = run_scene(scene);
  double lowest = 0, sag = 0;
  for (std::int64_t f = 0; f < trajectory.frames; ++f) {
    double mean = 0;
    for (std::int64_t p = 0; p < trajectory.particles; ++p) {
      mean += trajectory.positions(f)[3 * p + 1] / static_cast<double>(trajectory.particles);
    }
    if (f == 0) lowest = mean;
    sag = std::max(sag, lowest - mean);
  }
  // At rest the centre of a column sinks by ρ g H²/(3 E) = 0.2 mm; let go at once, by twice that.
  EXPECT_LT(sag, 1e-3);
  EXPECT_GT(sag, 1e-5);
}

/// The height of the middle 90 % of the particles, m.
double height_of(const std::vector<double>& x) {
  std::vector<double> y;
  for (std::size_t k = 1; k < x.size(); k += 3) y.push_back(x[k]);
  std::sort(y.begin(), y.end());
  return y[y.size() * 95 / 100] - y[y.size() * 5 / 100];
}

// A layer of sand across the box, dropped at 0 or 3 m/s. What it is made of stays as much as it
// was: 0.14 m, of which 90 % are 0.126 m. Without the correction every separation adds to it.
TEST(RunScene, SandKeepsItsVolumeWhateverItFellFrom) {
  BodyDescription layer = ball({0.5, 0.35, 0.5}, 0.7);
  layer.solid = std::make_shared<Box>(Vector3d{1, 0.2, 1});
  layer.filling = {Filling::Kind::spacing, 0, 0.035};
  layer.law.mu = layer.law.lambda = 1e5;
  layer.law.theta = 0.35;
  const auto height = [&](kernels::LawId id, double speed) {
    layer.law.id = id;
    layer.velocity[1] = -speed;
    SceneDescription scene = one(layer);
    scene.dt = 4e-4;
    scene.steps = 2500;
    return height_of(run_scene(scene).last.x);
  };
  for (const double speed : {0.0, 3.0}) {
    const double corrected = height(kernels::LawId::volume_corrected_sand, speed);
    EXPECT_NEAR(corrected, 0.126, 0.006) << speed;
    EXPECT_GT(height(kernels::LawId::sand, speed), corrected + 0.01) << speed;
  }
}

TEST(PlaceScene, LetsStatesOfEarlierRunsLeanOnTheWalls) {
  BodyDescription body = ball({0.5, 0.5, 0.5});
  body.solid = nullptr;
  body.cloud = std::make_shared<ParticleCloud>(
      ParticleCloud{{Vector3d(0.5, 0.13, 0.5), Vector3d(0.6, 0.13, 0.5)}, {1e-6, 1e-6}});
  body.in_place = true;
  EXPECT_EQ(error_of(one(body)), "no error");
  body.cloud = std::make_shared<ParticleCloud>(
      ParticleCloud{{Vector3d(0.5, 0.01, 0.5), Vector3d(0.6, 0.13, 0.5)}, {1e-6, 1e-6}});
  EXPECT_THAT(error_of(one(body)), HasSubstr("spans y from 0.01"));
}

TEST(PlaceScene, RefusesWhatCannotRun) {
  EXPECT_THAT(error_of(SceneDescription()), HasSubstr("at least one body"));
  SceneDescription scene = one(ball({0.5, 0.5, 0.5}));
  scene.bodies[0].law.mu = -1;
  EXPECT_THAT(error_of(scene), AllOf(HasSubstr("body \"ball\""), HasSubstr("mu")));
  scene = one(ball({0.5, 0.5, 0.5}));
  scene.dt = -1.0;
  EXPECT_THAT(error_of(scene), HasSubstr("dt: expected a positive number"));
  scene = one(ball({0.5, 0.5, 0.5}));
  scene.frame_stride = 0;
  EXPECT_THAT(error_of(scene), HasSubstr("frame_stride >= 1"));
  scene = one(ball({0.5, 0.5, 0.5}));
  scene.duration = 1e9;
  EXPECT_THAT(error_of(scene), HasSubstr("at most 1e9 steps"));
}

TEST(RunScene, NamesTheParticleThatLeavesTheGrid) {
  BodyDescription body = ball({0.5, 0.5, 0.5});
  body.velocity = {900, 0, 0};  // half a cube in one step of 0.5 ms
  try {
    run_scene(one(body));
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("particle"), HasSubstr("step")));
  }
}

TEST(PlaceScene, RefusesAGridThatDoesNotFitIntoMemory) {
  SceneDescription scene = one(ball({0.5, 0.5, 0.5}));
  scene.grid.n = 1024;
  EXPECT_THAT(testing::error_with_limit(RLIMIT_AS, rlim_t{4} << 30, [&] { place_scene(scene); }),
              HasSubstr("scene.grid: 1024 nodes a side take 34.4 GB, expected at most 4.29 GB"));
  scene.grid.n = 64;
  EXPECT_EQ(testing::error_with_limit(RLIMIT_AS, rlim_t{4} << 30, [&] { place_scene(scene); }), "");
}

// All bodies together, before their states are taken.
TEST(PlaceScene, RefusesParticlesThatDoNotFitIntoMemory) {
  SceneDescription scene = one(ball({0.3, 0.5, 0.5}));
  scene.bodies.push_back(ball({0.7, 0.5, 0.5}));
  for (BodyDescription& body : scene.bodies) body.filling.count = 500000;
  scene.bodies[1].name = "other";
  EXPECT_THAT(testing::error_with_limit(RLIMIT_AS, rlim_t{1} << 30, [&] { place_scene(scene); }),
              AllOf(HasSubstr("bodies.1.filling: "), HasSubstr("particles take 1.28 GB"),
                    HasSubstr("expected at most 1.07 GB")));
  for (BodyDescription& body : scene.bodies) body.filling.count = 50000;
  EXPECT_EQ(testing::error_with_limit(RLIMIT_AS, rlim_t{1} << 30, [&] { place_scene(scene); }), "");
}

}  // namespace
}  // namespace uniphy
