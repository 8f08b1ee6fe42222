#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "uniphy/geometry/random.hpp"

namespace uniphy {

/// A rotation, uniform over all of them.
/// K. Shoemake, Uniform random rotations, Graphics Gems III (1992).
inline Eigen::Matrix3d random_rotation(UniformRandom& random) {
  constexpr double kTurn = 6.283185307179586;
  const double u = random.unit(), a = kTurn * random.unit(), b = kTurn * random.unit();
  const double s = std::sqrt(1 - u), c = std::sqrt(u);
  return Eigen::Quaterniond(c * std::cos(b), s * std::sin(a), s * std::cos(a), c * std::sin(b))
      .toRotationMatrix();
}

}  // namespace uniphy
