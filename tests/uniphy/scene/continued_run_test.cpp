// scene.continue: a run that goes on has the bits of an uninterrupted one, or is refused.

#include "uniphy/scene/continued_run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "ops/kernels/laws/law_parameters.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/scene/scene_config.hpp"
#include "uniphy/scene/simulation_run.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

// Two bodies that meet, so that the order of summation matters.
std::string scene_of(const std::string& law) {
  return "scene: {grid: 16, dt: 2e-4, steps: 100, frame_stride: 30}\n"
         "output: {picture_frames: 0, fields: [v]}\n"
         "bodies:\n"
         "  - {name: a, shape: {type: sphere}, size: 0.25, center: [0.3, 0.33, 0.5],\n"
         "     velocity: [2, -3, 0.1], angular_velocity: [1, 2, 9],\n"
         "     filling: {type: random, particles: 300}, law: " +
         law +
         "}\n"
         "  - {name: b, shape: {type: box}, size: 0.2, center: [0.7, 0.33, 0.5],\n"
         "     velocity: [-2, -3, 0], filling: {type: lattice, particles: 250},\n"
         "     law: {type: sand, mu: 1e5, lambda: 1e5, theta: 0.5}}\n";
}
constexpr const char* kElastic = "{type: elastic, mu: 2e4, lambda: 4e4}";

class ContinuedRun : public ::testing::Test {
 protected:
  /// Runs into the folder `out`.
  Trajectory run(const std::string& out, const std::string& yaml,
                 const std::vector<std::string>& overrides) {
    const Config config = Config::parse(yaml, "scene.yaml", overrides);
    Section root = config.root();
    const SceneSource scene = read_scene(root);
    const SimulationOutput output = read_simulation_output(root);
    config.finish();
    std::filesystem::create_directories(scratch_.file(out));
    RunDirectory directory(scratch_.file(out), config.resolved(), 1);
    Metrics metrics;
    simulate_into(scene.load(), output, directory, metrics);
    return read_trajectory(file(out));
  }
  std::filesystem::path file(const std::string& out) const {
    return scratch_.file(out) / "trajectory.h5";
  }
  std::string going_on(const std::string& out) const {
    return "scene.continue=" + file(out).string();
  }
  std::string error(const std::string& yaml, const std::vector<std::string>& overrides,
                    const std::string& out = "refused") {
    return testing::without_directory(testing::error_of([&] { run(out, yaml, overrides); }),
                                      scratch_.path());
  }

  testing::Scratch scratch_;
};

void expect_same_end(const Trajectory& found, const Trajectory& expected) {
  EXPECT_EQ(found.last.x, expected.last.x);
  EXPECT_EQ(found.last.v, expected.last.v);
  EXPECT_EQ(found.last.C, expected.last.C);
  EXPECT_EQ(found.last.F, expected.last.F);
  EXPECT_EQ(found.last.memory, expected.last.memory);
  EXPECT_EQ(found.end->step, expected.end->step);
  EXPECT_EQ(found.end->sorted_x, expected.end->sorted_x);
}

TEST_F(ContinuedRun, HasTheBitsOfTheUninterruptedOne) {
  const char* const laws[] = {kElastic, "{type: newtonian, mu: 5, lambda: 1e4}",
                              "{type: non_newtonian, mu: 1e4, lambda: 1e5, tau_y: 100, eta: 10}"};
  for (const char* law : laws) {
    for (const char* dtype : {"scene.dtype=float64", "scene.dtype=float32"}) {
      const std::string yaml = scene_of(law);
      const Trajectory whole = run("whole", yaml, {dtype});
      ASSERT_FALSE(whole.last.memory.empty());
      // 47 is neither a frame's step nor one at which the particles are sorted.
      run("first", yaml, {dtype, "scene.steps=47"});
      const Trajectory second = run("second", yaml, {dtype, "scene.steps=43", going_on("first")});
      EXPECT_EQ(second.step, (std::vector<std::int64_t>{47, 60, 90}));
      const Trajectory third = run("third", yaml, {dtype, "scene.steps=10", going_on("second")});
      EXPECT_EQ(third.step, (std::vector<std::int64_t>{90}));
      expect_same_end(third, whole);
      for (const std::int64_t frame : {1, 2}) {  // steps 60 and 90, the third and fourth of `whole`
        const std::int64_t size = 3 * whole.particles;
        const auto part = [&](const std::vector<double>& all, std::int64_t at) {
          return std::vector<double>(all.begin() + at * size, all.begin() + (at + 1) * size);
        };
        EXPECT_EQ(part(second.x, frame), part(whole.x, frame + 1));
        EXPECT_EQ(part(second.v, frame), part(whole.v, frame + 1));
        EXPECT_EQ(second.time[frame], whole.time[frame + 1]);
      }
    }
  }
}

TEST_F(ContinuedRun, MayEndAtAFrame) {
  const Trajectory whole = run("whole", scene_of(kElastic), {"scene.steps=60"});
  run("first", scene_of(kElastic), {"scene.steps=50"});
  const Trajectory second = run("second", scene_of(kElastic),
                                {"scene.steps=", "scene.duration=0.002", going_on("first")});
  EXPECT_EQ(second.step, (std::vector<std::int64_t>{50, 60}));
  expect_same_end(second, whole);
}

TEST_F(ContinuedRun, IsRefusedAsAnotherScene) {
  const std::string yaml = scene_of(kElastic);
  run("first", yaml, {"scene.steps=10"});
  const std::string go = going_on("first");
  const std::string expected =
      "scene.continue: first/trajectory.h5: expected the scene that its run began with, ";
  EXPECT_EQ(error(yaml, {go, "scene.gravity=[0, -1, 0]"}),
            expected + "scene.gravity.1: -9.8, found -1");
  EXPECT_EQ(error(yaml, {go, "scene.dt=1e-4"}), expected + "scene.dt: 0.0002, found 0.0001");
  EXPECT_EQ(error(yaml, {go, "bodies.0.law.mu=3e4"}),
            expected + "bodies.0.law.mu: 20000, found 30000");
  EXPECT_EQ(error(yaml, {go, "bodies.1.law.volume_correction=false"}),
            expected + "bodies.1.law.volume_correction: true, found false");
  EXPECT_EQ(error(yaml + "  - {shape: {type: box}, size: 0.1, center: [0.3, 0.8, 0.5], law: " +
                      kElastic + "}\n",
                  {go}),
            expected + "bodies: a list of 2, found a list of 3");
  EXPECT_EQ(error(yaml, {go}, "first"),
            "scene.continue: expected a trajectory that this run does not replace, found "
            "first/trajectory.h5; another --out keeps both");
  EXPECT_THAT(error(yaml, {go, "output.observation=true"}), HasSubstr("found scene.continue"));
}

TEST_F(ContinuedRun, IsRefusedWhereAFileOfTheSceneHasChanged) {
  const auto cloud = [&](double y) {
    std::ofstream stream(scratch_.file("cloud.csv"));
    for (int k = 0; k < 8; ++k) {
      stream << 0.4 + 0.03 * (k % 2) << " " << (k == 7 ? y : 0.4 + 0.03 * (k / 2 % 2)) << " "
             << 0.4 + 0.03 * (k / 4) << "\n";
    }
  };
  const std::string yaml =
      "scene: {grid: 16, dt: 2e-4, steps: 10}\noutput: {picture_frames: 0}\n"
      "bodies: [{shape: {type: particles, file: " +
      scratch_.file("cloud.csv").string() +
      ", particle_volume: 1e-5}, size: 0.1, law: " + kElastic + "}]\n";
  cloud(0.43);
  run("first", yaml, {});
  run("second", yaml, {going_on("first")});
  cloud(0.5);  // larger bounds, hence smaller particles
  EXPECT_THAT(error(yaml, {going_on("first")}),
              HasSubstr("expected the masses, volumes and laws that its run began with"));
}

// A fitted law comes from a file, so that no key of the configuration shows a change.
TEST(SceneHash, SeesEveryParameterOfEveryLaw) {
  for (int i = 0; i < kernels::kAnalyticLaws; ++i) {
    SceneDescription scene;
    scene.bodies.emplace_back();
    kernels::LawDescription& law = scene.bodies[0].law;
    law.id = static_cast<kernels::LawId>(i);
    const std::string before = scene_hash(scene, {});
    for (const kernels::LawParameter& p : kernels::law_parameters(law.id)) {
      law.*p.member = 0.5;
      EXPECT_NE(scene_hash(scene, {}), before) << kernels::law_name(law.id) << " " << p.name;
      law.*p.member = 0;
    }
    EXPECT_EQ(scene_hash(scene, {}), before);
  }
}

TEST_F(ContinuedRun, IsRefusedFromTheFrameOfATrajectory) {
  run("first", scene_of(kElastic), {});
  const std::string body =
      "scene: {grid: 16}\noutput: {picture_frames: 0}\n"
      "bodies: [{shape: {type: particles, file: " +
      file("first").string() + ", frame: 1, in_place: true";
  EXPECT_THAT(error(body + "}, law: " + kElastic + "}]", {}),
              HasSubstr("in_place: expected positions of a body at rest, found a trajectory"));
  const Trajectory anew =
      run("anew", body + ", undeformed: true}, law: " + kElastic + "}]", {"scene.steps=0"});
  EXPECT_EQ(anew.last.v, std::vector<double>(3 * anew.particles, 0.0));
}

}  // namespace
}  // namespace uniphy
