#include "uniphy/evaluation/step_budget.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {
namespace {

constexpr std::int64_t kFirstTrial = 10;
constexpr std::int64_t kGrowth = 2;
constexpr double kTrialShare = 0.05;  ///< of the budget, that a trial has to take to be believed

}  // namespace

std::int64_t steps_within(double seconds, const std::function<double(std::int64_t)>& taken) {
  for (std::int64_t trial = kFirstTrial;; trial *= kGrowth) {
    const double time = taken(trial);
    if (time < kTrialShare * seconds) continue;
    return std::max<std::int64_t>(1, std::llround(seconds * double(trial) / time));
  }
}

}  // namespace uniphy
