// kind: open_world of uniphy_evaluate, from the configuration to the files, at a tiny size.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/uniphy/evaluation/small_run.hpp"
#include "uniphy/evaluation/evaluate_stage.hpp"
#include "uniphy/evaluation/open_world_cases.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

OutsideScene small_cube() {
  OutsideOptions o;
  o.steps = 100;
  o.objects = 0;
  o.per_side = 4;
  return outside_scenes(o)[0];
}

kernels::LawDescription soft() {
  kernels::LawDescription law;
  law.mu = 4e4;
  law.lambda = 3e4;
  return law;
}

TEST(OpenWorldCases, TheTrueLawIsExactOnTheGridOfTheTruthAlone) {
  const auto floor = [](OpenWorldCase c) {
    return open_world_motion(small_cube(), soft(), c, 0.005, 1).floor;
  };
  EXPECT_LT(floor(OpenWorldCase::closed), 1e-12);
  EXPECT_LT(floor(OpenWorldCase::noise), 1e-12);  // judged by where the particles are
  EXPECT_LT(floor(OpenWorldCase::tracked), 1e-12);
  EXPECT_GT(floor(OpenWorldCase::finer), 1e-4);
  EXPECT_LT(floor(OpenWorldCase::finer), 0.2);
}

TEST(OpenWorldCases, AFinerTruthStandsWhereTheCoarseOneDoes) {
  const OpenWorldMotion fine =
      open_world_motion(small_cube(), soft(), OpenWorldCase::finer, 0.005, 1);
  const OpenWorldMotion same =
      open_world_motion(small_cube(), soft(), OpenWorldCase::closed, 0.005, 1);
  const Observation &a = fine.motion.seen, &b = same.motion.seen;
  ASSERT_EQ(a.frames, b.frames);
  EXPECT_EQ(a.grid, b.grid);
  EXPECT_EQ(a.dt, b.dt);
  for (std::size_t k = 0; k < 3 * 64; ++k) EXPECT_NEAR(a.x[k], b.x[k], 1e-12);
  for (std::int64_t f = 0; f < a.frames; ++f) EXPECT_NEAR(a.time[f], b.time[f], 1e-12);
}

TEST(OpenWorldCases, ADeformedStartIsLaterInTheSameMotion) {
  const OpenWorldMotion later =
      open_world_motion(small_cube(), soft(), OpenWorldCase::deformed, 0.005, 1);
  const OpenWorldMotion all =
      open_world_motion(small_cube(), soft(), OpenWorldCase::closed, 0.005, 1);
  const Observation &a = later.motion.seen, &b = all.motion.seen;
  const std::int64_t first = b.frames / 5;
  ASSERT_EQ(a.frames, b.frames - first);
  EXPECT_EQ(a.start_degree, 2);
  EXPECT_EQ(a.time[0], b.time[first]);
  EXPECT_EQ(a.x, std::vector<double>(b.positions(first), b.positions(b.frames)));
}

TEST(OpenWorldCases, AForecastBeginsWithTheWholeState) {
  const OpenWorldMotion later =
      open_world_motion(small_cube(), soft(), OpenWorldCase::deformed, 0.005, 1);
  InitialState state(RigidMotion{centre_of_mass(later.motion.seen), {0, -1, 0}, {0, 0, 0}});
  state.degree = 1;
  state.numbers.assign(static_cast<std::size_t>(initial_numbers(1) - 6), 0.0);
  const double still = forecast_error(later.motion, soft(), state, "float64");
  state.numbers[0] = 2;    // 1/s, along x
  state.numbers[6] = 0.3;  // of the stretch, likewise
  EXPECT_GT(std::abs(forecast_error(later.motion, soft(), state, "float64") - still), 1e-4);
}

TEST(OpenWorldCases, ATenthOfThePointsInEveryTenthFrame) {
  const OpenWorldMotion m =
      open_world_motion(small_cube(), soft(), OpenWorldCase::hidden, 0.005, 1);
  EXPECT_EQ(m.motion.seen.points(), 6);
  EXPECT_EQ(m.motion.seen.frames, 3);
  EXPECT_EQ(m.motion.truth.size(), 3u * 64 * 3);
  EXPECT_GT(std::count_if(m.motion.seen.x.begin(), m.motion.seen.x.end(),
                          [](double x) { return std::isnan(x); }),
            0);
}

TEST(OpenWorldCases, ACloudOfHalfOfTheParticlesInEveryOtherFrame) {
  const OpenWorldMotion m = open_world_motion(small_cube(), soft(), OpenWorldCase::cloud, 0.005, 1);
  const std::int64_t frames =
      (open_world_motion(small_cube(), soft(), OpenWorldCase::closed, 0, 1).motion.seen.frames +
       1) /
      2;
  EXPECT_EQ(m.motion.seen.cloud, 32);
  EXPECT_EQ(m.motion.seen.frames, frames);
  EXPECT_FALSE(m.motion.seen.tracked());
  EXPECT_EQ(m.motion.truth.size(), static_cast<std::size_t>(frames) * 64 * 3);
  EXPECT_LT(m.floor, 1e-12);
}

TEST(OpenWorld, MakesTheTableAndGoesOn) {
  const testing::Scratch scratch;
  write_model(scratch.file("model.h5"), testing::readable_model(4));
  const std::string yaml = "kind: open_world\nmodel: " + scratch.file("model.h5").string() +
                           "\nmaterials: [elastic]\ncases: [noise, tracked, finer]\n"
                           "scene: {steps: 100, objects: 1, particles: 40, per_side: 4}\n"
                           "fit: {schedule: {horizon: [1], candidates: [1], epochs: [1]}}\n"
                           "adaptation: {rungs: [latent]}\n";
  const auto out = scratch.file("out");
  const Metrics first = testing::run_stage(evaluate_stage, yaml, out);
  EXPECT_EQ(first.find("fits"), 5);  // finer: the cube alone
  for (const char* name : {"forecast.noise.elastic", "fit.tracked.elastic", "floor.finer.elastic",
                           "fit_s.noise.elastic", "fit_rollouts.noise.elastic"}) {
    ASSERT_TRUE(first.find(name)) << name;
    EXPECT_GT(*first.find(name), 0) << name;
  }
  EXPECT_TRUE(first.find("named_right.noise.elastic"));
  EXPECT_THAT(read_text_file(out / "open_world.md"), HasSubstr("| tracked |"));
  EXPECT_EQ(testing::run_stage(evaluate_stage, yaml, out, 1).json(), first.json());
}

}  // namespace
}  // namespace uniphy
