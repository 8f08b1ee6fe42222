#include "uniphy/evaluation/step_budget.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace uniphy {
namespace {

constexpr double kTrialShare = 0.05;  ///< of the budget, that a trial has to take to be believed
constexpr double kLargestOnce = 0.5;  ///< of a trial, that may be what every training does once

}  // namespace

std::int64_t steps_within(double seconds, const std::function<double(std::int64_t)>& taken) {
  // The lesser of two: the first training in a process is slower.
  double first = taken(1);
  first = std::min(first, taken(1));
  double time = first;
  std::int64_t trial = 1;
  while (trial == 1 || time < kTrialShare * seconds) time = taken(trial *= 2);
  const double step =
      std::max((time - first) / double(trial - 1), (1 - kLargestOnce) * time / double(trial));
  const double once = time - step * double(trial);
  return std::max<std::int64_t>(1, std::llround((seconds - once) / step));
}

}  // namespace uniphy
