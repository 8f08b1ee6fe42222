#include "uniphy/geometry/shapes/box.hpp"

#include <algorithm>

namespace uniphy {

Box::Box(const Eigen::Vector3d& sides) : half_(0.5 * sides) {
  check_positive("box", "sides", sides);
}

double Box::distance(const Eigen::Vector3d& p) const {
  const Eigen::Vector3d q = p.cwiseAbs() - half_;
  return q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0);
}

}  // namespace uniphy
