#pragma once

#include <cstdint>
#include <functional>

namespace uniphy {

/// How many steps of a training fit in `seconds` (s), at least one. `taken(n)` trains n steps from
/// the start and returns how long that took, in s. Trials grow until one has taken a twentieth of
/// the budget; a step costs what that trial took, less what the shortest trial took, of which at
/// most half of the longest is believed. So a disturbed trial makes at most twice too many steps,
/// where the bare difference of two trials could be nothing, and the steps any number.
std::int64_t steps_within(double seconds, const std::function<double(std::int64_t)>& taken);

}  // namespace uniphy
