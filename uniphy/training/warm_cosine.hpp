#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace uniphy {

/// The learning rate of a step: it falls from `rate` to zero along a cosine, after a short warm-up,
/// since Adam's first steps are as large as the rate whatever the gradient.
inline double warm_cosine(double rate, std::int64_t step, std::int64_t steps) {
  const double warm = std::min(1.0, double(step + 1) / 100.0);
  return warm * rate * 0.5 * (1 + std::cos(M_PI * double(step) / double(steps)));
}

}  // namespace uniphy
