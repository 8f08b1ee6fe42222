#include "uniphy/geometry/shapes/torus.hpp"

#include <cmath>

namespace uniphy {

Torus::Torus(double major, double minor) : major_(major), minor_(minor) {
  check_positive("torus", "major", major);
  check_parameter(minor > 0 && minor < major, "torus", "minor", minor,
                  "more than 0 and less than major");
}

double Torus::distance(const Eigen::Vector3d& p) const {
  return std::hypot(std::hypot(p[0], p[2]) - major_, p[1]) - minor_;
}

Bounds Torus::bounds() const {
  const Eigen::Vector3d corner(major_ + minor_, minor_, major_ + minor_);
  return {-corner, corner};
}

double Torus::volume() const { return 2 * M_PI * M_PI * major_ * minor_ * minor_; }

}  // namespace uniphy
