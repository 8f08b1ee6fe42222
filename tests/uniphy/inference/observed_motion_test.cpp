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

TEST(ObservedSteps, TimesBetweenStepsAreRefused) {
  Observation o;
  o.dt = 1e-3;
  o.frames = 2;
  o.time = {0, 0.0045};
  EXPECT_THAT(testing::error_of([&] { observed_steps(o, "seen.h5"); }),
              HasSubstr("seen.h5: /time: expected frames at whole multiples of dt = 0.001 s, found "
                        "0.0045 s at frame 1"));
  o.time = {0, 1e-6};  // rounds to no step at all
  testing::error_of([&] { observed_steps(o, "seen.h5"); });
}

}  // namespace
}  // namespace uniphy
