#pragma once

#include <Eigen/Core>
#include <vector>

namespace uniphy {

/// The velocity field of a rigid body, v(x) = linear + angular × (x − centre).
struct RigidMotion {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();   ///< m
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();   ///< m/s
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  ///< rad/s

  /// x [particles, 3] → v [particles, 3].
  std::vector<double> velocities(const std::vector<double>& x) const;
};

}  // namespace uniphy
