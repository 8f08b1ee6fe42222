#include "uniphy/geometry/shapes/knurling.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {

Knurling::Knurling(double radius, double height, double depth, int grooves, double turns)
    : radius_(radius), half_height_(0.5 * height), depth_(depth), grooves_(grooves) {
  check_positive("knurling", "radius", radius);
  check_positive("knurling", "height", height);
  check_parameter(depth > 0 && depth < 0.25 * radius, "knurling", "depth", depth,
                  "more than 0 and less than radius/4");
  check_parameter(grooves >= 3 && grooves <= 200, "knurling", "grooves", grooves,
                  "a number from 3 to 200");
  check_parameter(std::isfinite(turns), "knurling", "turns", turns, "a finite number");
  twist_ = 2 * M_PI * grooves * turns / height;
  // Largest slopes of the radial distance, along the radius (the blend below included), round the
  // axis (at half the radius) and along the axis.
  const double out = 1 + 4 * depth / radius;
  const double round = depth * grooves / radius;
  const double up = 0.5 * depth * twist_;
  slope_ = std::sqrt(out * out + round * round + up * up);
}

double Knurling::distance(const Eigen::Vector3d& p) const {
  const double r = std::hypot(p[0], p[2]);
  // The grooves end above 3/4 of the radius; below, their pattern is blended out, or its slope
  // round the axis would grow without limit.
  const double blend = std::clamp(4 * r / radius_ - 2, 0.0, 1.0);
  const double phase = grooves_ * std::atan2(p[2], p[0]);
  // Beyond the ends the pattern goes on as it is there, so that its slope never adds to the caps'.
  const double lift = twist_ * std::clamp(p[1], -half_height_, half_height_);
  const double ridge = std::max(std::cos(phase + lift), std::cos(phase - lift));
  const double groove = 0.5 * depth_ * (1 + ridge);
  const double radial = (r - radius_ + blend * groove) / slope_;
  const double axial = std::abs(p[1]) - half_height_;
  return std::min(std::max(radial, axial), 0.0) +
         std::hypot(std::max(radial, 0.0), std::max(axial, 0.0));
}

Bounds Knurling::bounds() const {
  const Eigen::Vector3d corner(radius_, half_height_, radius_);
  return {-corner, corner};
}

}  // namespace uniphy
