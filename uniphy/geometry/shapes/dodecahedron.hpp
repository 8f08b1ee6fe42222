#pragma once

#include "uniphy/geometry/shapes/convex_polyhedron.hpp"

namespace uniphy {

/// Regular dodecahedron with corners at (±1, ±1, ±1), (0, ±1/φ, ±φ) and their cyclic permutations,
/// scaled to the circumscribed radius; φ is the golden ratio. Exact. Volume (15 + 7√5)/4 a³ with
/// the edge a = 4 radius/(√3 (1 + √5)).
class Dodecahedron final : public ConvexPolyhedron {
 public:
  explicit Dodecahedron(double radius = 0.5);  ///< of the circumscribed sphere, m
};

}  // namespace uniphy
