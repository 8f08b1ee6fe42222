// The criteria of a roll-out: each violation is found, with its step and its particle.

#include "uniphy/stability/run_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/uniphy/stability/stability_cases.hpp"
#include "uniphy/stability/stability_runs.hpp"

namespace uniphy::stability {
namespace {

using ::testing::HasSubstr;

struct Watched {
  PlacedScene placed = place_scene(cube_on_floor(testing::elastic_law(), 3, 10));
  RunWatch watch{placed};
  ParticleState state = ParticleState::undeformed(placed.x, placed.v);

  Watched() { EXPECT_TRUE(watch.look(0, state)); }
};

TEST(RunWatch, AStateAsItBeganHolds) {
  Watched w;
  EXPECT_TRUE(w.watch.look(10, w.state));
  Cell cell;
  w.watch.report(cell);
  EXPECT_EQ(cell.verdict, Verdict::holds);
  EXPECT_EQ(cell.find("energy_growth"), 0);
  EXPECT_EQ(cell.find("energy_kept"), 1);
  EXPECT_EQ(cell.find("least_det_F"), 1);
}

TEST(RunWatch, EnergyThatGrowsIsDatedAndTheFastestParticleNamed) {
  Watched w;
  w.state.v[3 * 5] += 20;
  EXPECT_FALSE(w.watch.look(10, w.state));
  EXPECT_TRUE(w.watch.violated());
  EXPECT_EQ(w.watch.failure().step, 10);
  EXPECT_EQ(w.watch.failure().particle, 5);
  EXPECT_THAT(w.watch.failure().cause, HasSubstr("energy"));
  EXPECT_GT(w.watch.growth(), kEnergyTolerance);
}

TEST(RunWatch, FallingFreelyDoesNotCount) {
  Watched w;
  const double t = 0.01, g = 9.8;
  for (std::size_t p = 0; p < w.placed.mass.size(); ++p) {
    w.state.x[3 * p + 1] += w.state.v[3 * p + 1] * t - 0.5 * g * t * t;
    w.state.v[3 * p + 1] -= g * t;
  }
  EXPECT_TRUE(w.watch.look(10, w.state));
  EXPECT_NEAR(w.watch.growth(), 0, 1e-12);
}

TEST(RunWatch, CollapseAndInversionAndNaNAreFound) {
  Watched collapsed, inverted, lost;
  for (int k = 0; k < 9; k += 4) collapsed.state.F[9 * 7 + k] = 0.009;  // det F = 7.3e-7
  EXPECT_FALSE(collapsed.watch.look(20, collapsed.state));
  EXPECT_EQ(collapsed.watch.failure().particle, 7);
  EXPECT_THAT(collapsed.watch.failure().cause, HasSubstr("det F = 7.29e-07"));

  inverted.state.F[9 * 2] = -1;
  EXPECT_FALSE(inverted.watch.look(20, inverted.state));
  EXPECT_EQ(inverted.watch.failure().particle, 2);

  lost.state.C[9 * 4 + 3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(lost.watch.look(30, lost.state));
  EXPECT_EQ(lost.watch.failure().step, 30);
  EXPECT_EQ(lost.watch.failure().particle, 4);
  EXPECT_THAT(lost.watch.failure().cause, HasSubstr("not finite"));
}

TEST(RunWatch, ASceneThatCannotBePlacedStops) {
  SceneDescription scene = cube_on_floor(testing::elastic_law(), 3, 10);
  scene.bodies.front().placement.size = 2;
  Cell cell;
  run_checked(scene, cell);
  EXPECT_EQ(cell.verdict, Verdict::stops);
  EXPECT_THAT(cell.failure.cause, HasSubstr("the space between the walls"));
}

TEST(RunWatch, AFailureThatTheUserWasWarnedOfSaysSo) {
  SceneDescription scene = cube_on_floor(testing::plasticine_law(), 10, 100);
  scene.dt = 5 * place_scene(scene).stable_dt;
  Cell cell;
  run_checked(scene, cell);
  EXPECT_EQ(cell.verdict, Verdict::fails);
  EXPECT_EQ(cell.find("warnings"), 1);
  EXPECT_THAT(cell.failure.cause, HasSubstr("warned of before the run"));
}

TEST(RunWatch, ASoftBodyCollapsesAtTwentyMetresASecondAndNotAtOne) {
  const kernels::LawDescription soft = testing::elastic_law(350, 500);
  Cell slow, fast;
  run_checked(thrown_at_wall(soft, 1, 10, 300), slow);
  EXPECT_EQ(slow.verdict, Verdict::holds);
  run_checked(thrown_at_wall(soft, 50, 10, 300), fast);
  EXPECT_EQ(fast.verdict, Verdict::fails);
  EXPECT_THAT(fast.failure.cause, HasSubstr("collapsed"));
}

}  // namespace
}  // namespace uniphy::stability
