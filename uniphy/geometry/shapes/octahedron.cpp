#include "uniphy/geometry/shapes/octahedron.hpp"

namespace uniphy {
namespace {

std::vector<Eigen::Vector3d> octahedron_corners(double r) {
  check_positive("octahedron", "radius", r);
  return {{r, 0, 0}, {-r, 0, 0}, {0, r, 0}, {0, -r, 0}, {0, 0, r}, {0, 0, -r}};
}

}  // namespace

Octahedron::Octahedron(double radius) : ConvexPolyhedron(octahedron_corners(radius)) {}

}  // namespace uniphy
