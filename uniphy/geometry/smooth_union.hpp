#pragma once

#include <algorithm>
#include <cmath>

namespace uniphy {

/// Union of two distances with a fillet of about `width` m (the polynomial smooth minimum,
/// m = min(a,b) − h²k/4 with h = max(k − |a−b|, 0)/k; I. Quilez, "Smooth minimum"). Its gradient is
/// a convex combination of those of a and b, so a bound stays a bound; at most width/4 is added.
inline double smooth_union(double a, double b, double width) {
  if (width <= 0) return std::min(a, b);
  const double h = std::max(width - std::abs(a - b), 0.0) / width;
  return std::min(a, b) - 0.25 * h * h * width;
}

}  // namespace uniphy
