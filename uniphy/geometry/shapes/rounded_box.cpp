#include "uniphy/geometry/shapes/rounded_box.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {

RoundedBox::RoundedBox(const Eigen::Vector3d& sides, double radius)
    : half_(0.5 * sides), radius_(radius) {
  check_positive("rounded_box", "sides", sides);
  check_parameter(radius > 0 && radius < half_.minCoeff(), "rounded_box", "radius", radius,
                  "more than 0 and less than half the shortest side");
}

double RoundedBox::distance(const Eigen::Vector3d& p) const {
  const Eigen::Vector3d q = p.cwiseAbs() - half_ + Eigen::Vector3d::Constant(radius_);
  return q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0) - radius_;
}

double RoundedBox::volume() const {
  const Eigen::Vector3d s = 2 * (half_ - Eigen::Vector3d::Constant(radius_));
  const double r = radius_;
  return s.prod() + 2 * r * (s[0] * s[1] + s[1] * s[2] + s[2] * s[0]) + M_PI * r * r * s.sum() +
         4 * M_PI / 3 * r * r * r;
}

}  // namespace uniphy
