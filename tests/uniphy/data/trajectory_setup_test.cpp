#include "uniphy/data/trajectory_setup.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

GenerateOptions options_of(const std::string& yaml) {
  Config config = Config::parse(yaml, "g.yaml");
  Section root = config.root();
  GenerateOptions options = read_generate_options(root);
  config.finish();
  return options;
}

void expect_same(const TrajectorySetup& a, const TrajectorySetup& b) {
  EXPECT_EQ(a.record.shape, b.record.shape);
  EXPECT_EQ(a.motion, b.motion);
  EXPECT_EQ(a.law().mu, b.law().mu);
  const PlacedScene pa = place_scene(a.scene), pb = place_scene(b.scene);
  EXPECT_EQ(pa.x, pb.x);
  EXPECT_EQ(pa.v, pb.v);
}

TEST(TrajectorySetup, SameArgumentsSameScene) {
  const GenerateOptions options = options_of("trajectories: 3\n");
  for (std::int64_t i = 0; i < options.total(); ++i) {
    expect_same(draw_setup(options, i, 0), draw_setup(options, i, 0));
  }
  const auto first = draw_setup(options, 1, 0), second = draw_setup(options, 1, 1);
  EXPECT_NE(first.law().mu, second.law().mu);
  EXPECT_NE(first.law().mu, draw_setup(options_of("{trajectories: 3, seed: 2}"), 1, 0).law().mu);
}

TEST(TrajectorySetup, ParametersFillTheRanges) {
  const GenerateOptions options = options_of("trajectories: 20\n");
  for (std::size_t m = 0; m < options.materials.size(); ++m) {
    const MaterialRanges& ranges = options.materials[m];
    std::set<int> parts;
    for (std::int64_t i = 0; i < 20; ++i) {
      const auto setup = draw_setup(options, static_cast<std::int64_t>(m) * 20 + i, 0);
      EXPECT_EQ(setup.record.material, ranges.name());
      for (std::size_t k = 0; k < 5; ++k) {
        const double value = setup.record.parameters[k];
        if (std::isnan(value)) continue;
        EXPECT_GE(value, ranges.interval[k][0] * (1 - 1e-12));
        EXPECT_LE(value, ranges.interval[k][1] * (1 + 1e-12));
      }
      const double place = std::log(setup.law().mu / ranges.interval[0][0]) /
                           std::log(ranges.interval[0][1] / ranges.interval[0][0]);
      parts.insert(static_cast<int>(place * 20));
    }
    EXPECT_EQ(parts.size(), 20u) << "mu of " << ranges.name() << " leaves parts of its range out";
  }
}

TEST(TrajectorySetup, BodiesStandBetweenTheWallsAndMoveTowardsThem) {
  const GenerateOptions options = options_of("trajectories: 12\n");
  std::set<std::string> motions, shapes;
  for (std::int64_t i = 0; i < options.total(); ++i) {
    const TrajectorySetup setup = draw_setup(options, i, 0);
    motions.insert(setup.motion);
    shapes.insert(setup.record.shape);
    const BodyDescription& body = setup.scene.bodies.front();
    const double speed = body.velocity.norm();
    EXPECT_GE(speed, options.speed[0] * (1 - 1e-12));
    EXPECT_LE(speed, options.speed[1] * (1 + 1e-12));
    EXPECT_LE(body.angular_velocity.norm(), 10);
    const PlacedScene placed = place_scene(setup.scene);  // throws where a wall is in the way
    EXPECT_NEAR(static_cast<double>(placed.particles()), 500, 125);
    if (setup.motion != "falling") continue;
    double lowest = 1;
    for (std::size_t k = 1; k < placed.x.size(); k += 3) lowest = std::min(lowest, placed.x[k]);
    EXPECT_LT(lowest, 0.15 + 0.15 + 0.03);
  }
  EXPECT_EQ(motions.size(), 5u);
  EXPECT_GE(shapes.size(), 8u);
}

TEST(TrajectorySetup, SplitsShareWhatTheyShould) {
  const auto train = options_of("{trajectories: 6, split: train}");
  const auto materials = options_of("{trajectories: 6, split: heldout_materials}");
  const auto all = options_of("{trajectories: 6, split: heldout_all}");
  std::set<double> mu;
  for (std::int64_t i = 0; i < train.total(); ++i) {
    const auto a = draw_setup(train, i, 0), b = draw_setup(materials, i, 0),
               c = draw_setup(all, i, 0);
    mu.insert({a.law().mu, b.law().mu, c.law().mu});
    EXPECT_EQ(a.record.shape, b.record.shape);
    EXPECT_EQ(a.motion, b.motion);
    EXPECT_EQ(a.scene.bodies[0].placement.rotation, b.scene.bodies[0].placement.rotation);
    EXPECT_NE(a.scene.bodies[0].placement.rotation, c.scene.bodies[0].placement.rotation);
    EXPECT_EQ(std::count(train.shapes.begin(), train.shapes.end(), c.record.shape), 0)
        << c.record.shape << " is a shape of train";
  }
  EXPECT_EQ(mu.size(), static_cast<std::size_t>(3 * train.total()));
}

TEST(TrajectorySetup, StepsAreFixedUnlessTheyAreNotStable) {
  const auto fixed = options_of("trajectories: 10\n");
  for (std::int64_t i = 0; i < fixed.total(); ++i) {
    const auto setup = draw_setup(fixed, i, 0);
    const double stable = place_scene(setup.scene).stable_dt / kTimeStepSafety;
    EXPECT_LE(setup.record.dt, 0.7 * stable);
    // The law of non_newtonian depends on the step: one for the whole set.
    if (setup.record.material == "non_newtonian") {
      EXPECT_EQ(setup.record.dt, 1.0 / 4800);
    }
  }
  const auto long_steps = options_of("{trajectories: 2, simulation: {dt: 0.01}}");
  EXPECT_LT(draw_setup(long_steps, 0, 0).record.dt, 0.01);
  const auto automatic = options_of("{trajectories: 10, simulation: {dt: auto}}");
  std::set<double> steps;
  for (std::int64_t i = 0; i < 10; ++i) steps.insert(draw_setup(automatic, i, 0).record.dt);
  EXPECT_GT(steps.size(), 3u);
}

TEST(GenerateOptionsTest, BadValuesAreRefused) {
  using testing::error_of;
  const auto message = [](const std::string& yaml) { return error_of([&] { options_of(yaml); }); };
  EXPECT_EQ(message("trajectories: 0\n"),
            "g.yaml:1: trajectories: expected an integer in [1, 100000], found \"0\"");
  EXPECT_THAT(message("split: test\n"), ::testing::HasSubstr("split: expected"));
  EXPECT_THAT(message("materials: [elastic, jelly]\n"), ::testing::HasSubstr("jelly"));
  EXPECT_THAT(message("materials: []\n"), ::testing::HasSubstr("materials: expected"));
  EXPECT_THAT(message("ranges: {sand: {tau_y: [1, 2]}}\n"),
              ::testing::HasSubstr("ranges.sand.tau_y"));
  EXPECT_THAT(message("ranges: {sand: {theta: [0.3, 0.1]}}\n"),
              ::testing::HasSubstr("ranges.sand.theta"));
  EXPECT_THAT(message("body: {size: [0.2, 0.5]}\n"),
              ::testing::HasSubstr("body.size: expected bodies that fit between the walls"));
  EXPECT_THAT(message("simulation: {bound: 8}\n"),
              ::testing::HasSubstr("simulation.bound: expected walls that leave half"));
  EXPECT_THAT(message("{simulation: {steps: 50}, samples: {every: 60}}\n"),
              ::testing::HasSubstr("samples.every: expected at most the 50 steps"));
  EXPECT_THAT(message("samples: {drawn: {share: 1.5}}\n"),
              ::testing::HasSubstr("samples.drawn.share"));
  EXPECT_THAT(message("simulation: {dt: soon}\n"), ::testing::HasSubstr("simulation.dt"));
  EXPECT_THAT(message("smaples: {}\n"), ::testing::HasSubstr("smaples"));
}

}  // namespace
}  // namespace uniphy
