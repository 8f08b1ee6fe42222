#pragma once

#include "uniphy/geometry/shapes/convex_polyhedron.hpp"

namespace uniphy {

/// Regular octahedron |x| + |y| + |z| ≤ radius. Exact.
class Octahedron final : public ConvexPolyhedron {
 public:
  explicit Octahedron(double radius = 0.5);  ///< of the circumscribed sphere, m
};

}  // namespace uniphy
