// What a simulation leaves in its output directory.

#include "uniphy/scene/simulation_run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/observation.hpp"
#include "uniphy/scene/scene_config.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

struct Job {
  SceneDescription scene;
  SimulationOutput output;
};

Job read_job(const std::string& bodies) {
  const Config config = Config::parse(
      "scene: {grid: 16, dt: 5e-4, steps: 40, frame_stride: 10, walls: noslip, "
      "gravity: [0, -3, 1], bound: 2}\n"
      "output: {observation: true, picture_frames: 0}\n"
      "bodies: " +
      bodies);
  Section root = config.root();
  const SceneSource source = read_scene(root);
  const SimulationOutput output = read_simulation_output(root);
  config.finish();
  return {source.load(), output};
}

void simulate(const Job& job, const testing::Scratch& scratch) {
  RunDirectory out(scratch.path(), "yaml", 1);
  Metrics metrics;
  simulate_into(job.scene, job.output, out, metrics);
}

constexpr const char* kBall =
    "{name: ball, shape: {type: sphere}, size: 0.2, filling: {type: lattice, particles: 100}, "
    "density: 700, law: {type: elastic, mu: 1e4, lambda: 1e4}}";

TEST(SimulationRun, WritesTheObservationThatInferenceReads) {
  const testing::Scratch scratch;
  simulate(read_job("[" + std::string(kBall) + "]"), scratch);
  const Trajectory trajectory = read_trajectory(scratch.file("trajectory.h5"));
  const Observation seen = read_observation(scratch.file("observation.h5"));
  EXPECT_EQ(seen.frames, 5);
  EXPECT_EQ(seen.x, trajectory.x);
  EXPECT_EQ(seen.time, trajectory.time);
  EXPECT_EQ(seen.volume, trajectory.volume);
  EXPECT_EQ(seen.grid, 16);
  EXPECT_EQ(seen.dt, 5e-4);
  EXPECT_EQ(seen.walls, "noslip");
  EXPECT_EQ(seen.bound, 2);
  EXPECT_EQ(seen.density, 700);
  EXPECT_EQ(seen.gravity, (std::array<double, 3>{0, -3, 1}));
}

TEST(SimulationRun, ObservesSingleBodiesOnly) {
  const testing::Scratch scratch;
  const Job job = read_job("[" + std::string(kBall) +
                           ", {name: other, center: [0.8, 0.5, 0.5], size: 0.1, "
                           "law: {type: water, lambda: 1e4}}]");
  EXPECT_THAT(testing::error_of([&] { simulate(job, scratch); }),
              HasSubstr("output.observation: expected a scene of one body, found 2"));
}

}  // namespace
}  // namespace uniphy
