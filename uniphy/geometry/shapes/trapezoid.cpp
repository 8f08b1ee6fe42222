#include "uniphy/geometry/shapes/trapezoid.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {

double trapezoid_distance(double x, double y, double bottom, double top, double half_height) {
  x = std::abs(x);
  // Nearest point of the flat end on y's side.
  const double end_width = y < 0 ? bottom : top;
  const double cap_x = x - std::min(x, end_width);
  const double cap_y = std::abs(y) - half_height;
  // Nearest point of the slanted side from (bottom, −h) to (top, h).
  const double side_x = top - bottom, side_y = 2 * half_height;
  const double along =
      ((x - bottom) * side_x + (y + half_height) * side_y) / (side_x * side_x + side_y * side_y);
  const double s = std::clamp(along, 0.0, 1.0);
  const double slant_x = x - (bottom + s * side_x), slant_y = y - (-half_height + s * side_y);
  // The normal of the side points to +x: the point is inside when it lies behind it and between
  // the ends.
  const bool inside = cap_y < 0 && (x - bottom) * side_y - (y + half_height) * side_x < 0;
  const double magnitude = std::min(std::hypot(cap_x, cap_y), std::hypot(slant_x, slant_y));
  return inside ? -magnitude : magnitude;
}

}  // namespace uniphy
