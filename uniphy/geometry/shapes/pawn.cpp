#include "uniphy/geometry/shapes/pawn.hpp"

#include <algorithm>
#include <cmath>

#include "uniphy/geometry/shapes/trapezoid.hpp"
#include "uniphy/geometry/smooth_union.hpp"

namespace uniphy {
namespace {

// Disc of outer radius `radius` and thickness 2 `half` round the height y0, its rim a half circle.
double rimmed_disc(double r, double y, double radius, double y0, double half) {
  return std::hypot(std::max(r - (radius - half), 0.0), y - y0) - half;
}

}  // namespace

Pawn::Pawn(double fillet) : fillet_(fillet) {
  // Up to here no fillet bulges beyond the foot and the head, so the bounds stay as they are.
  check_parameter(fillet >= 0 && fillet <= 0.09, "pawn", "fillet", fillet,
                  "a number from 0 to 0.09");
}

double Pawn::distance(const Eigen::Vector3d& p) const {
  const double r = std::hypot(p[0], p[2]), y = p[1];
  double d = rimmed_disc(r, y, 0.31, 0.07, 0.07);                                  // foot
  d = smooth_union(d, rimmed_disc(r, y, 0.25, 0.17, 0.05), fillet_);               // its upper ring
  d = smooth_union(d, trapezoid_distance(r, y - 0.4, 0.2, 0.085, 0.24), fillet_);  // body
  d = smooth_union(d, rimmed_disc(r, y, 0.18, 0.64, 0.028), fillet_);              // collar
  return smooth_union(d, std::hypot(r, y - 0.82) - 0.18, 0.5 * fillet_);           // head
}

}  // namespace uniphy
