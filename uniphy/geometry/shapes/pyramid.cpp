#include "uniphy/geometry/shapes/pyramid.hpp"

namespace uniphy {
namespace {

std::vector<Eigen::Vector3d> pyramid_corners(double base, double height) {
  check_positive("pyramid", "base", base);
  check_positive("pyramid", "height", height);
  const double h = 0.5 * base, low = -0.25 * height;
  return {{-h, low, -h}, {h, low, -h}, {h, low, h}, {-h, low, h}, {0, 0.75 * height, 0}};
}

}  // namespace

Pyramid::Pyramid(double base, double height) : ConvexPolyhedron(pyramid_corners(base, height)) {}

}  // namespace uniphy
