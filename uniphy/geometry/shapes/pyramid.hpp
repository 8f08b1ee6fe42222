#pragma once

#include "uniphy/geometry/shapes/convex_polyhedron.hpp"

namespace uniphy {

/// Pyramid on a square base in the plane y = −height/4, apex at y = 3 height/4: the origin is its
/// centre of mass. Exact.
class Pyramid final : public ConvexPolyhedron {
 public:
  explicit Pyramid(double base = 1, double height = 0.8);  ///< side of the base, height, m
};

}  // namespace uniphy
