#include "uniphy/geometry/shapes/gear.hpp"

#include <algorithm>
#include <cmath>

#include "uniphy/geometry/shapes/trapezoid.hpp"

namespace uniphy {

Gear::Gear(double tip_radius, double root_radius, double bore_radius, double thickness, int teeth)
    : root_(root_radius), bore_(bore_radius), half_thickness_(0.5 * thickness), teeth_(teeth) {
  check_positive("gear", "tip_radius", tip_radius);
  check_parameter(root_radius > 0 && root_radius < tip_radius, "gear", "root_radius", root_radius,
                  "more than 0 and less than tip_radius");
  check_parameter(bore_radius >= 0 && bore_radius < root_radius, "gear", "bore_radius", bore_radius,
                  "at least 0 and less than root_radius");
  check_positive("gear", "thickness", thickness);
  check_parameter(teeth >= 3 && teeth <= 200, "gear", "teeth", teeth, "a number from 3 to 200");
  // A tooth fills 60 % of its pitch at the root and 35 % at the tip. It starts a little inside the
  // root circle, so that tooth and disc overlap.
  const double pitch = 2 * M_PI / teeth;
  const double start = 0.8 * root_radius;
  foot_ = root_radius * std::sin(0.3 * pitch);
  tip_ = tip_radius * std::sin(0.175 * pitch);
  // The corners of the tip lie on the tip circle.
  const double end = std::sqrt(tip_radius * tip_radius - tip_ * tip_);
  tooth_centre_ = 0.5 * (start + end);
  tooth_half_height_ = 0.5 * (end - start);
  // The outermost points are corners of tips (or, with few teeth, of the root circle).
  bounds_.min = Eigen::Vector3d(-root_radius, -half_thickness_, -root_radius);
  bounds_.max = -bounds_.min;
  for (int tooth = 0; tooth < teeth; ++tooth) {
    for (const double side : {-0.175, 0.175}) {
      const double angle = pitch * (tooth + side);
      const Eigen::Vector3d corner(tip_radius * std::cos(angle), 0, tip_radius * std::sin(angle));
      bounds_.min = bounds_.min.cwiseMin(corner);
      bounds_.max = bounds_.max.cwiseMax(corner);
    }
  }
}

double Gear::profile(double x, double z) const {
  const double r = std::hypot(x, z);
  // By symmetry the nearest tooth is the one whose sector holds the point.
  const double pitch = 2 * M_PI / teeth_;
  double angle = std::atan2(z, x);
  angle -= pitch * std::round(angle / pitch);
  const double tooth = trapezoid_distance(r * std::sin(angle), r * std::cos(angle) - tooth_centre_,
                                          foot_, tip_, tooth_half_height_);
  const double solid = std::min(r - root_, tooth);
  return bore_ > 0 ? std::max(solid, bore_ - r) : solid;
}

double Gear::distance(const Eigen::Vector3d& p) const {
  const double radial = profile(p[0], p[2]);
  const double axial = std::abs(p[1]) - half_thickness_;
  return std::min(std::max(radial, axial), 0.0) +
         std::hypot(std::max(radial, 0.0), std::max(axial, 0.0));
}

}  // namespace uniphy
