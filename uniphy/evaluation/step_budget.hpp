#pragma once

#include <cstdint>
#include <functional>

namespace uniphy {

/// How many steps of a training fit in `seconds` (s), at least one. `taken(n)` trains n steps from
/// the start and returns how long that took, in s. Trials grow until one has taken a twentieth
/// of the budget, and the result is that trial's own pace: what every training does once counts as
/// if it were done again and again, and a trial that was disturbed gives too few steps. Never the
/// difference of two trials, which noise can bring to nothing, and the steps to any number.
std::int64_t steps_within(double seconds, const std::function<double(std::int64_t)>& taken);

}  // namespace uniphy
