#include "uniphy/geometry/shapes/cylinder.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {

Cylinder::Cylinder(double radius, double height) : radius_(radius), half_height_(0.5 * height) {
  check_positive("cylinder", "radius", radius);
  check_positive("cylinder", "height", height);
}

double Cylinder::distance(const Eigen::Vector3d& p) const {
  const double radial = std::hypot(p[0], p[2]) - radius_;
  const double axial = std::abs(p[1]) - half_height_;
  return std::min(std::max(radial, axial), 0.0) +
         std::hypot(std::max(radial, 0.0), std::max(axial, 0.0));
}

Bounds Cylinder::bounds() const {
  const Eigen::Vector3d corner(radius_, half_height_, radius_);
  return {-corner, corner};
}

double Cylinder::volume() const { return 2 * M_PI * radius_ * radius_ * half_height_; }

}  // namespace uniphy
