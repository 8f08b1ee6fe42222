#include "uniphy/inference/observed_motion.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

TEST(ObservedMotion, IsFoundFromPositionsWhateverTheMaterial) {
  const testing::ObservedScene scene;
  kernels::LawDescription water;
  water.id = kernels::LawId::water;
  water.lambda = 1e5;
  for (const auto& law : {testing::elastic_body(), testing::elastic_body(3e5, 4e5), water}) {
    const Observation o = testing::observe(law, scene);
    const RigidMotion m = observed_motion(o, observed_steps(o, "o"), observed_grid(o, "o"), 1);
    EXPECT_LT((m.centre - scene.motion.centre).norm(), 1e-12);
    EXPECT_LT((m.linear - scene.motion.linear).norm(), 1e-9);
    EXPECT_LT((m.angular - scene.motion.angular).norm(), 3e-3 * scene.motion.angular.norm());
  }
}

TEST(ObservedMotion, MoreFramesAverageOutNoise) {
  testing::ObservedScene scene;
  scene.motion.angular.setZero();
  Observation o = testing::observe(testing::elastic_body(), scene);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 2e-4);
  for (double& x : o.x) x += noise(random);
  const auto error = [&](int frames) {
    return (observed_motion(o, observed_steps(o, "o"), observed_grid(o, "o"), frames).linear -
            scene.motion.linear)
        .norm();
  };
  EXPECT_LT(error(8), 0.5 * error(1));
}

TEST(ObservedMotion, IsKnownToTheSpreadThatTheNoiseLeaves) {
  testing::ObservedScene scene;
  scene.motion.centre = {0.5, 0.6, 0.5};
  scene.frames = 11;
  const Observation truth = testing::observe(testing::elastic_body(), scene);
  const auto steps = observed_steps(truth, "o");
  const auto grid = observed_grid(truth, "o");
  std::array<double, 6> error{}, spread{};
  constexpr int kDraws = 40;
  std::mt19937 random(1);
  for (int draw = 0; draw < kDraws; ++draw) {
    Observation o = truth;
    std::normal_distribution<double> noise(0, 1e-3);
    for (double& x : o.x) x += noise(random);
    o.noise = 1e-3;
    const MotionEstimate found = estimate_motion(o, steps, grid);
    for (int k = 0; k < 6; ++k) {
      const double off = k < 3 ? found.motion.linear[k] - scene.motion.linear[k]
                               : found.motion.angular[k - 3] - scene.motion.angular[k - 3];
      error[k] += off * off / kDraws;
      spread[k] += found.spread[k] * found.spread[k] / kDraws;
    }
  }
  for (int k = 0; k < 6; ++k) {
    EXPECT_GT(spread[k], 0.7 * error[k]) << k;
    EXPECT_LT(spread[k], 3 * error[k]) << k;
  }
}

TEST(ObservedMotion, ContactIsSeenWhereGravityAloneDoesNotExplainTheMotion) {
  const testing::ObservedScene scene;
  const Observation o = testing::observe(testing::elastic_body(), scene);
  const auto steps = observed_steps(o, "o");
  const auto grid = observed_grid(o, "o");
  const std::ptrdiff_t contact = first_contact(o, steps, grid, observed_motion(o, steps, grid, 1));
  // The lowest corner of the turning box stands 0.0225 m above the wall and falls at 1.5 to 1.8
  // m/s.
  EXPECT_GE(contact, 3);
  EXPECT_LE(contact, 12);

  testing::ObservedScene high = scene;
  high.motion.centre = {0.5, 0.5, 0.5};
  high.frames = 10;
  const Observation free = testing::observe(testing::elastic_body(), high);
  EXPECT_EQ(first_contact(free, observed_steps(free, "o"), grid,
                          observed_motion(free, observed_steps(free, "o"), grid, 1)),
            10);
}

TEST(ObservedMotion, CloudsAreNotComplete) {
  Observation o;
  o.frames = 2;
  o.particles = 1;
  o.x.assign(6, 0.5);
  EXPECT_TRUE(is_complete(o));
  o.cloud = 1;
  o.body.assign(3, 0.5);
  EXPECT_FALSE(is_complete(o));
}

TEST(ObservedSteps, FramesMayBeUneven) {
  Observation o;
  o.dt = 1e-3;
  o.time = {0.5, 0.504, 0.51, 0.522};
  o.frames = 4;
  const ObservedSteps steps = observed_steps(o, "o");
  EXPECT_THAT(steps.step, ::testing::ElementsAre(0, 4, 10, 22));
  EXPECT_EQ(steps.stride, 2);
  EXPECT_EQ(steps.last(2), 4);
}

TEST(ObservedSteps, TimesMayLieBetweenSteps) {
  Observation o;
  o.dt = 1e-3;
  o.time = {0.5, 0.5045, 0.51, 0.51001};  // the last one is the step before it, to a hundredth
  o.frames = 4;
  const ObservedSteps steps = observed_steps(o, "o");
  EXPECT_THAT(steps.step, ::testing::ElementsAre(0, 4, 10, 10));
  EXPECT_EQ(steps.fraction[0], 0);
  EXPECT_NEAR(steps.fraction[1], 0.5, 1e-9);
  EXPECT_EQ(steps.fraction[2], 0);
  EXPECT_EQ(steps.fraction[3], 0);
  EXPECT_EQ(steps.stride, 1);
  EXPECT_EQ(steps.last(2), 5);
  EXPECT_EQ(steps.last(3), 10);
}

/// A body that falls far from the walls, of which some points are tracked.
Observation tracked_fall(std::int64_t every) {
  testing::ObservedScene scene;
  scene.motion.centre = {0.5, 0.55, 0.5};
  scene.frames = 12;
  Observation o = testing::observe(testing::elastic_body(), scene);
  o.body = o.start();
  std::vector<double> x;
  for (std::int64_t f = 0; f < o.frames; ++f) {
    for (std::int64_t p = 0; p < o.particles; p += every)
      x.insert(x.end(), o.positions(f) + 3 * p, o.positions(f) + 3 * p + 3);
  }
  o.tracers.assign(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size()) / o.frames);
  o.x = x;
  return o;
}

TEST(ObservedMotion, IsFoundFromTrackedPointsOfWhichSomeAreHidden) {
  Observation o = tracked_fall(17);
  const testing::ObservedScene scene;
  for (int k = 0; k < 3; ++k) {
    o.x[3 * 2 + k] = o.tracers[3 * 2 + k] = std::nan("");  // in the first frame
    o.x[3 * (o.points() + 4) + k] = std::nan("");          // in the second
  }
  const RigidMotion m = observed_motion(o, observed_steps(o, "o"), observed_grid(o, "o"), 1);
  EXPECT_LT((m.linear - scene.motion.linear).norm(), 2e-3);
  EXPECT_LT((m.angular - scene.motion.angular).norm(), 1e-2 * scene.motion.angular.norm());
}

TEST(ObservedMotion, TakesAsManyFramesAsTheNoiseAsksFor) {
  Observation o = tracked_fall(3);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 1e-3);
  for (double& x : o.x) x += noise(random);
  std::copy_n(o.x.begin(), o.tracers.size(), o.tracers.begin());
  const auto steps = observed_steps(o, "o");
  const auto grid = observed_grid(o, "o");
  const Eigen::Vector3d truth = testing::ObservedScene{}.motion.linear;
  o.noise = 1e-3;
  const double many = (observed_motion(o, steps, grid).linear - truth).norm();
  EXPECT_LT(many, 0.4 * (observed_motion(o, steps, grid, 1).linear - truth).norm());
  o.noise = 0;  // as it says
  EXPECT_EQ(observed_motion(o, steps, grid).linear, observed_motion(o, steps, grid, 1).linear);
}

TEST(ObservedMotion, ContactOfTrackedPointsIsWhereTheBodyReachesAWall) {
  Observation o = tracked_fall(17);
  const auto steps = observed_steps(o, "o");
  const auto grid = observed_grid(o, "o");
  RigidMotion motion = testing::ObservedScene{}.motion;
  motion.centre = centre_of_mass(o);
  EXPECT_EQ(first_contact(o, steps, grid, motion), o.frames);
  motion.linear[1] = -40;  // 0.1 m a frame; the lowest particles begin 0.206 m above the reach
  EXPECT_EQ(first_contact(o, steps, grid, motion), 3);
}

}  // namespace
}  // namespace uniphy
