// What a simulation leaves in its output directory.

#include "uniphy/scene/simulation_run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/base/between_steps.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/observation.hpp"
#include "uniphy/report/interrupt.hpp"
#include "uniphy/report/plot.hpp"
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

TEST(SimulationRun, ObservesEachOfSeveralBodies) {
  const testing::Scratch scratch;
  const char* other =
      ", {name: other, center: [0.8, 0.5, 0.5], size: 0.1, density: 900, law: {type: water, "
      "lambda: "
      "1e4}}]";
  simulate(read_job("[" + std::string(kBall) + other), scratch);
  const std::vector<ObservedBody> seen = read_observed_bodies(scratch.file("observation.h5"));
  const Trajectory whole = read_trajectory(scratch.file("trajectory.h5"));
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_EQ(seen[1].name, "other");
  EXPECT_EQ(seen[1].motion.density, 900);
  EXPECT_EQ(seen[0].motion.particles + seen[1].motion.particles, whole.particles);
  for (std::int64_t f = 0; f < whole.frames; ++f) {
    const auto of = [&](int b) {
      const Observation& o = seen[b].motion;
      return std::vector<double>(o.positions(f), o.positions(f) + 3 * o.particles);
    };
    std::vector<double> x = of(0);
    const std::vector<double> rest = of(1);
    x.insert(x.end(), rest.begin(), rest.end());
    EXPECT_EQ(x, std::vector<double>(whole.positions(f), whole.positions(f + 1)));
  }
  const Job bad = read_job("[" + std::string(kBall) + ", {name: \"a/b\"" + (other + 14));
  EXPECT_THAT(testing::error_of([&] { simulate(bad, scratch); }),
              HasSubstr("output.observation: bodies.1.name: expected letters, digits"));
}

// Leaves the grid after step 13; frames of steps 0, 2, ... 12.
constexpr const char* kBlowUp =
    "scene: {grid: 200, dt: 2e-4, steps: 400, frame_stride: 2}\n"
    "output: {observation: true, fields: [F]}\n"
    "bodies: [{shape: {type: box}, center: [0.5, 0.2, 0.5], size: 0.06, velocity: [0, -5, 0], "
    "filling: {type: per_side, count: 12}, law: {type: elastic, mu: 2e6, lambda: 4e6}}]\n";

int run_simulate(const testing::Scratch& scratch, const std::string& yaml, std::string* err) {
  const std::string config = scratch.write("scene.yaml", yaml).string();
  const std::string out = scratch.file("out").string();
  const char* argv[] = {"uniphy_simulate", config.c_str(), "--out", out.c_str()};
  ::testing::internal::CaptureStderr();
  const int code = run_experiment(4, argv, {"uniphy_simulate", "", {}, {}, {}},
                                  [](Section& root) -> RunFunction {
                                    const SceneSource scene = read_scene(root);
                                    const SimulationOutput output = read_simulation_output(root);
                                    return [=](RunDirectory& directory, Metrics& metrics) {
                                      simulate_into(scene.load(), output, directory, metrics);
                                    };
                                  });
  *err = ::testing::internal::GetCapturedStderr();
  return code;
}

std::string last_line(std::string text) {
  text.pop_back();
  return text.substr(text.rfind('\n') + 1);
}

TEST(SimulationRun, KeepsTheFramesOfARunThatFails) {
  const testing::Scratch scratch;
  std::string err;
  // A good run first, whose files must not pass for those of the failed one.
  std::string good = kBlowUp;
  good.replace(good.find("steps: 400"), 10, "steps: 12");
  ASSERT_EQ(run_simulate(scratch, good, &err), 0) << err;
  const Trajectory whole = read_trajectory(scratch.file("out/trajectory.h5"));
  EXPECT_EQ(whole.failure, "");
  EXPECT_TRUE(std::filesystem::exists(scratch.file("out/observation.h5")));
  std::filesystem::remove(scratch.file("out/frames.png"));

  EXPECT_EQ(run_simulate(scratch, kBlowUp, &err), 1);
  const std::string message = last_line(err);
  EXPECT_THAT(message,
              ::testing::MatchesRegex("error: particle .* left the grid after step 13 .*"));
  EXPECT_THAT(err,
              HasSubstr("trajectory.h5: keeps the frames up to 0.0024 s, marked as incomplete"));
  const Trajectory kept = read_trajectory(scratch.file("out/trajectory.h5"));
  EXPECT_EQ("error: " + kept.failure, message);
  EXPECT_EQ(kept.step, (std::vector<std::int64_t>{0, 2, 4, 6, 8, 10, 12}));
  EXPECT_EQ(kept.x, whole.x);
  EXPECT_EQ(kept.F, whole.F);
  EXPECT_TRUE(kept.last.x.empty());
  EXPECT_THAT(kept.scene, HasSubstr("steps: 400"));
  EXPECT_TRUE(std::filesystem::exists(scratch.file("out/trajectory.xdmf")));
  EXPECT_EQ(std::filesystem::exists(scratch.file("out/frames.png")), gnuplot_available());
  EXPECT_FALSE(std::filesystem::exists(scratch.file("out/observation.h5")));
  EXPECT_FALSE(std::filesystem::exists(scratch.file("out/metrics.json")));
  EXPECT_FALSE(std::filesystem::exists(scratch.file("out/trajectory.h5.tmp")));
}

TEST(SimulationRun, KeepsTheFramesOfARunThatIsInterrupted) {
  const testing::Scratch scratch;
  static int calls = 0;
  calls = 0;
  Job job = read_job("[" + std::string(kBall) + "]");
  kernels::between_steps = [] {
    if (++calls == 3) throw Interrupted();
  };
  std::string error = "none";
  try {
    simulate(job, scratch);
  } catch (const Interrupted& interrupted) {
    error = interrupted.what();
  }
  kernels::between_steps = nullptr;
  EXPECT_EQ(error, Interrupted().what());
  const Trajectory kept = read_trajectory(scratch.file("trajectory.h5"));
  EXPECT_EQ(kept.failure, error);
  EXPECT_EQ(kept.step, (std::vector<std::int64_t>{0, 10, 20}));
}

TEST(SimulationRun, FramesOfAFailedRunAreUsedWithAWarning) {
  const testing::Scratch scratch;
  std::string err;
  ASSERT_EQ(run_simulate(scratch, kBlowUp, &err), 1);
  ::testing::internal::CaptureStderr();
  read_job("[{shape: {type: particles, file: " + scratch.file("out/trajectory.h5").string() +
           ", frame: 1, in_place: true, undeformed: true}, law: {type: water, lambda: 1e4}}]");
  EXPECT_THAT(::testing::internal::GetCapturedStderr(),
              HasSubstr("trajectory.h5: is of a run that failed: particle 4 at"));
}

}  // namespace
}  // namespace uniphy
