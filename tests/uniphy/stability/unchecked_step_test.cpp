// The unchecked step is the engine's as long as nothing goes wrong, and shows what goes wrong.

#include "uniphy/stability/unchecked_step.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/uniphy/stability/stability_cases.hpp"
#include "uniphy/stability/stability_runs.hpp"

namespace uniphy::stability {
namespace {

using ::testing::HasSubstr;

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  EXPECT_EQ(a.size(), b.size());
  double most = 0;
  for (std::size_t k = 0; k < a.size(); ++k) most = std::max(most, std::abs(a[k] - b[k]));
  return most;
}

TEST(UncheckedStep, IsTheEnginesStepWhereNothingGoesWrong) {
  for (const kernels::LawDescription& law : {testing::elastic_law(), testing::plasticine_law()}) {
    const SceneDescription scene = cube_on_floor(law, 4, 60);
    const PlacedScene placed = place_scene(scene);
    UncheckedRollout rollout(scene, placed, 0);
    for (int k = 0; k < 60; ++k) rollout.step();
    const ParticleState end = run_scene(
        scene, placed, {}, [](double, std::int64_t, const ParticleState&) { return true; });
    EXPECT_LT(largest_difference(end.x, rollout.state().x), 1e-12);
    EXPECT_LT(largest_difference(end.v, rollout.state().v), 1e-10);
    EXPECT_LT(largest_difference(end.F, rollout.state().F), 1e-10);
  }
}

TEST(UncheckedStep, GoesOnWithNumbersThatAreNotFiniteWhereTheEngineStops) {
  kernels::LawDescription fluid = testing::elastic_law(100, 1e5);
  fluid.id = kernels::LawId::newtonian;
  SceneDescription scene = cube_on_floor(fluid, 4, 200);
  scene.dt = 16 * place_scene(scene).stable_dt;
  Cell unchecked, checked;
  run_unchecked(scene, 0, unchecked);
  EXPECT_EQ(unchecked.verdict, Verdict::fails);
  EXPECT_THAT(unchecked.failure.cause, HasSubstr("not finite"));

  const PlacedScene placed = place_scene(scene);
  UncheckedRollout rollout(scene, placed, 0);
  for (int k = 0; k < 200; ++k) rollout.step();
  bool finite = true;
  for (const double v : rollout.state().v) finite = finite && std::isfinite(v);
  EXPECT_FALSE(finite);
  for (const double x : rollout.state().x) EXPECT_TRUE(x >= 0.025 && x < 0.925) << x;

  run_checked(scene, checked);
  EXPECT_EQ(checked.verdict, Verdict::stops);
  EXPECT_GE(checked.failure.step, 1);
  EXPECT_GE(checked.failure.particle, 0);
  EXPECT_THAT(checked.failure.cause,
              HasSubstr("particle " + std::to_string(checked.failure.particle) + " "));
  EXPECT_THAT(checked.failure.cause,
              HasSubstr("after step " + std::to_string(checked.failure.step) + " "));

  scene.dt.reset();
  Cell automatic;
  run_checked(scene, automatic);
  EXPECT_EQ(automatic.verdict, Verdict::holds);
  EXPECT_EQ(automatic.find("steps"), 200);
}

TEST(UncheckedStep, MassEpsilonLosesMomentumAndAThresholdDoesNot) {
  const SceneDescription scene = free_flight(testing::elastic_law(), 1, 4, 100);
  const auto momentum = [&](double epsilon) {
    const PlacedScene placed = place_scene(scene);
    UncheckedRollout rollout(scene, placed, epsilon);
    for (int k = 0; k < 100; ++k) rollout.step();
    double sum = 0, before = 0;
    for (std::ptrdiff_t p = 0; p < placed.particles(); ++p) {
      sum += placed.mass[p] * rollout.state().v[3 * p];
      before += placed.mass[p] * placed.v[3 * p];
    }
    return sum / before;
  };
  EXPECT_NEAR(momentum(0), 1, 1e-12);
  EXPECT_LT(momentum(kMassEpsilon), 0.99);
  EXPECT_GT(momentum(kMassEpsilon), 0.5);
}

}  // namespace
}  // namespace uniphy::stability
