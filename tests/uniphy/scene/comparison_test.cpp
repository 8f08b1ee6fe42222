#include "uniphy/scene/comparison.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

using testing::HasSubstr;

// Two particles of two bodies, 0.4 m apart, at rest; `frames` frames, 0.1 s apart.
Trajectory still(int frames) {
  Trajectory t;
  t.frames = frames;
  t.particles = 2;
  t.body = {0, 1};
  for (int frame = 0; frame < frames; ++frame) {
    t.time.push_back(0.1 * frame);
    t.step.push_back(frame);
    t.x.insert(t.x.end(), {0.3, 0.5, 0.5, 0.7, 0.6, 0.5});
  }
  return t;
}

std::string error_of(const Trajectory& a, const Trajectory& b, FrameMatch match) {
  try {
    compare_trajectories(a, b, match, "a.h5", "b.h5");
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(CompareTrajectories, EqualOnesAreAtDistanceZero) {
  const auto result = compare_trajectories(still(3), still(3), FrameMatch::all);
  EXPECT_EQ(result.position_mse, 0);
  EXPECT_EQ(result.largest_distance, 0);
  EXPECT_NEAR(result.size, 0.4, 1e-15);
}

TEST(CompareTrajectories, MeanOverFramesParticlesAndCoordinates) {
  Trajectory moved = still(4);
  // In the last frame the second particle is 0.03, 0, 0.04 away.
  moved.x[3 * 6 + 3] += 0.03;
  moved.x[3 * 6 + 5] += 0.04;
  const auto result = compare_trajectories(moved, still(4), FrameMatch::all);
  EXPECT_NEAR(result.position_mse, 0.0025 / (4 * 2 * 3), 1e-17);
  EXPECT_NEAR(result.final_mse, 0.0025 / 6, 1e-16);
  EXPECT_NEAR(result.largest_distance, 0.05, 1e-15);
  EXPECT_NEAR(result.root_over_size, std::sqrt(0.0025 / 24) / 0.4, 1e-14);
  ASSERT_EQ(result.frame_mse.size(), 4u);
  EXPECT_EQ(result.frame_mse[2], 0);
  ASSERT_EQ(result.body_mse.size(), 2u);
  EXPECT_EQ(result.body_mse[0], 0);
  EXPECT_NEAR(result.body_mse[1], 0.0025 / 12, 1e-16);
}

TEST(CompareTrajectories, CommonFramesAreThoseOfTheSameTime) {
  Trajectory fine = still(9);
  for (int frame = 0; frame < 9; ++frame) fine.time[frame] = 0.05 * frame;
  fine.x[6 * 1] += 1;  // at 0.05 s, which the other one does not have
  const auto result = compare_trajectories(fine, still(5), FrameMatch::common);
  EXPECT_EQ(result.time.size(), 5u);
  EXPECT_EQ(result.position_mse, 0);
}

TEST(CompareTrajectories, RefusesWhatDoesNotMatch) {
  Trajectory other = still(3);
  other.particles = 1;
  EXPECT_THAT(error_of(other, still(3), FrameMatch::all),
              HasSubstr("a.h5: expected 2 particles, as b.h5 has, found 1"));
  EXPECT_THAT(error_of(still(2), still(3), FrameMatch::all),
              HasSubstr("a.h5: expected the 3 times of b.h5"));
  Trajectory late = still(3);
  for (double& time : late.time) time += 0.05;
  EXPECT_THAT(error_of(late, still(3), FrameMatch::all), HasSubstr("of which 0 agree"));
  EXPECT_THAT(error_of(late, still(3), FrameMatch::common), HasSubstr("no time in common"));
}

TEST(CompareTrajectories, IncompleteOnesAreRefusedUnlessTheirFramesAreAskedFor) {
  Trajectory incomplete = still(3);
  incomplete.failure = "particle 4 left the grid";
  const std::string expected =
      "a.h5: expected a complete trajectory, found one that ends at 0.2 s because its run failed "
      "(particle 4 left the grid); frames: common compares the frames that it has";
  EXPECT_EQ(error_of(incomplete, incomplete, FrameMatch::all), expected);
  EXPECT_EQ(error_of(incomplete, still(3), FrameMatch::all), expected);
  EXPECT_EQ(error_of(incomplete, still(4), FrameMatch::common), "no error");
}

}  // namespace
}  // namespace uniphy
