#include "uniphy/geometry/shapes/rounded_cone.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {
namespace {

// Part of a sphere of this radius beyond the plane at `offset` from its centre (may be negative).
double cap_volume(double radius, double offset) {
  const double height = radius - offset;
  return M_PI * height * height * (3 * radius - height) / 3;
}

}  // namespace

RoundedCone::RoundedCone(double bottom_radius, double top_radius, double spacing)
    : bottom_(bottom_radius), top_(top_radius), spacing_(spacing) {
  check_positive("rounded_cone", "bottom_radius", bottom_radius);
  check_positive("rounded_cone", "top_radius", top_radius);
  check_parameter(spacing > std::abs(bottom_radius - top_radius), "rounded_cone", "spacing",
                  spacing, "more than the difference of the radii");
  slope_ = (bottom_ - top_) / spacing_;
  run_ = std::sqrt(1 - slope_ * slope_);
}

double RoundedCone::distance(const Eigen::Vector3d& p) const {
  const double r = std::hypot(p[0], p[2]), y = p[1];
  // Position along the side, whose ends are the circles of contact with the two spheres.
  const double along = -slope_ * r + run_ * y;
  if (along <= 0) return std::hypot(r, y) - bottom_;
  if (along >= run_ * spacing_) return std::hypot(r, y - spacing_) - top_;
  return run_ * r + slope_ * y - bottom_;
}

Bounds RoundedCone::bounds() const {
  const double r = std::max(bottom_, top_);
  return {{-r, -bottom_, -r}, {r, spacing_ + top_, r}};
}

double RoundedCone::volume() const {
  const double low_offset = slope_ * bottom_, high_offset = slope_ * top_;
  const double low = run_ * bottom_, high = run_ * top_;  // radii of the circles of contact
  const double height = spacing_ + high_offset - low_offset;
  return M_PI / 3 * height * (low * low + low * high + high * high) +
         cap_volume(bottom_, -low_offset) + cap_volume(top_, high_offset);
}

}  // namespace uniphy
