#include "uniphy/geometry/shapes/capped_cone.hpp"

#include <algorithm>
#include <cmath>

#include "uniphy/geometry/shapes/trapezoid.hpp"

namespace uniphy {

CappedCone::CappedCone(double bottom_radius, double top_radius, double height)
    : bottom_(bottom_radius), top_(top_radius), half_height_(0.5 * height) {
  check_parameter(bottom_radius >= 0, "capped_cone", "bottom_radius", bottom_radius,
                  "a number >= 0");
  check_parameter(top_radius >= 0, "capped_cone", "top_radius", top_radius, "a number >= 0");
  check_positive("capped_cone", "bottom_radius + top_radius", bottom_radius + top_radius);
  check_positive("capped_cone", "height", height);
}

double CappedCone::distance(const Eigen::Vector3d& p) const {
  return trapezoid_distance(std::hypot(p[0], p[2]), p[1], bottom_, top_, half_height_);
}

Bounds CappedCone::bounds() const {
  const double r = std::max(bottom_, top_);
  const Eigen::Vector3d corner(r, half_height_, r);
  return {-corner, corner};
}

double CappedCone::volume() const {
  return 2 * M_PI / 3 * half_height_ * (bottom_ * bottom_ + bottom_ * top_ + top_ * top_);
}

}  // namespace uniphy
