#include "uniphy/geometry/shapes/dodecahedron.hpp"

#include <cmath>

namespace uniphy {
namespace {

std::vector<Eigen::Vector3d> dodecahedron_corners(double radius) {
  check_positive("dodecahedron", "radius", radius);
  const double unit = radius / std::sqrt(3.0);
  const double phi = 0.5 * (1 + std::sqrt(5.0));
  std::vector<Eigen::Vector3d> corners;
  for (int a = -1; a <= 1; a += 2) {
    for (int b = -1; b <= 1; b += 2) {
      const double short_side = a * unit / phi, long_side = b * unit * phi;
      corners.insert(
          corners.end(),
          {{0, short_side, long_side}, {short_side, long_side, 0}, {long_side, 0, short_side}});
      for (int c = -1; c <= 1; c += 2) corners.push_back({a * unit, b * unit, c * unit});
    }
  }
  return corners;
}

}  // namespace

Dodecahedron::Dodecahedron(double radius) : ConvexPolyhedron(dodecahedron_corners(radius)) {}

}  // namespace uniphy
