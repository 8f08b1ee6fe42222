#include "uniphy/inference/rigid_motion.hpp"

#include <Eigen/Geometry>

namespace uniphy {

using Eigen::Map;
using Eigen::Vector3d;

std::vector<double> RigidMotion::velocities(const std::vector<double>& x) const {
  std::vector<double> v(x.size());
  for (std::size_t k = 0; k < x.size(); k += 3) {
    Map<Vector3d>(v.data() + k) =
        linear + angular.cross(Map<const Vector3d>(x.data() + k) - centre);
  }
  return v;
}

}  // namespace uniphy
