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

std::array<double, 6> RigidMotion::gradient(const std::vector<double>& x,
                                            const std::vector<double>& grad_v) const {
  Vector3d by_linear = Vector3d::Zero(), by_angular = Vector3d::Zero();
  for (std::size_t k = 0; k < x.size(); k += 3) {
    const Vector3d g = Map<const Vector3d>(grad_v.data() + k);
    by_linear += g;
    // g · (ω × r) = ω · (r × g)
    by_angular += (Map<const Vector3d>(x.data() + k) - centre).cross(g);
  }
  return {by_linear[0], by_linear[1], by_linear[2], by_angular[0], by_angular[1], by_angular[2]};
}

}  // namespace uniphy
