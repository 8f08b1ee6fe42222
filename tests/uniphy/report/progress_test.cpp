#include "uniphy/report/progress.hpp"

#include <gtest/gtest.h>

namespace uniphy {
namespace {

TEST(Progress, LineTellsDoneTotalRateAndTimeLeft) {
  const Progress progress("simulate", 1000, "steps");
  EXPECT_EQ(progress.line(250, 10, ""), "simulate: 250/1000 steps (25%), 25/s, 30 s left");
  EXPECT_EQ(progress.line(250, 10, "loss 3e-4"),
            "simulate: 250/1000 steps (25%), 25/s, 30 s left, loss 3e-4");
  EXPECT_EQ(progress.line(1000, 500, ""), "simulate: 1000/1000 steps (100%), 2/s, 8:20 min");
  EXPECT_EQ(progress.line(1, 20, ""), "simulate: 1/1000 steps (0%), 0.05/s, 5:33 h left");
  EXPECT_EQ(progress.line(0, 0, ""), "simulate: 0/1000 steps (0%)");
}

TEST(Progress, UnknownTotalHasNoTimeLeft) {
  const Progress progress("read", 0, "frames");
  EXPECT_EQ(progress.line(12345, 10, ""), "read: 12345 frames, 1234/s, 10 s");
}

TEST(Progress, ShortWorkPrintsNothingIntoALog) {
  ::testing::internal::CaptureStderr();
  {
    Progress progress("quick", 10, "steps");
    for (int i = 1; i <= 10; ++i) progress.update(i);
  }
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace uniphy
