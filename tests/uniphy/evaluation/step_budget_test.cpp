// Steps from seconds, with made-up clocks.

#include "uniphy/evaluation/step_budget.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace uniphy {
namespace {

TEST(StepsWithin, FitTheBudgetAndUseMostOfIt) {
  for (const double once : {0.0, 0.3}) {
    for (const double step : {1e-5, 1e-3, 0.2}) {
      const auto taken = [&](std::int64_t steps) { return once + step * double(steps); };
      const double whole = taken(steps_within(60, taken));
      EXPECT_LE(whole, 63) << once << " " << step;
      EXPECT_GE(whole, 54) << once << " " << step;
    }
  }
}

TEST(StepsWithin, TrialsTakeAFifthOfTheBudgetAtMost) {
  double spent = 0;
  steps_within(60, [&](std::int64_t steps) {
    const double time = 1e-4 * double(steps);
    spent += time;
    return time;
  });
  EXPECT_LE(spent, 12);
}

TEST(StepsWithin, AreAtLeastOne) {
  EXPECT_EQ(steps_within(0.5, [](std::int64_t) { return 1000.0; }), 1);
}

// The first trial pays for what the process does once, and the next ones look as if their further
// steps had cost nothing.
TEST(StepsWithin, ADisturbedTrialMakesAtMostTwiceTooMany) {
  constexpr double kStep = 1e-3;
  for (const std::vector<double>& delays :
       {std::vector<double>{5, 5, 0}, {5, 0, 0}, {0.05, 0.04, 0}, {0, 5, 0}, {0, 0, 0.5}}) {
    std::size_t call = 0;
    const std::int64_t steps = steps_within(1, [&](std::int64_t n) {
      const double delay = call < delays.size() ? delays[call] : 0;
      ++call;
      return delay + kStep * double(n);
    });
    EXPECT_GE(steps, 1);
    EXPECT_LE(steps, 2000);
  }
}

}  // namespace
}  // namespace uniphy
