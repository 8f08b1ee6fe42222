#include "uniphy/geometry/shapes/sphere.hpp"

#include <cmath>

namespace uniphy {

Sphere::Sphere(double radius) : radius_(radius) { check_positive("sphere", "radius", radius); }

Bounds Sphere::bounds() const {
  const Eigen::Vector3d corner = Eigen::Vector3d::Constant(radius_);
  return {-corner, corner};
}

double Sphere::volume() const { return 4 * M_PI / 3 * radius_ * radius_ * radius_; }

}  // namespace uniphy
