#pragma once

// Momentum to velocity, gravity and walls, on every node of a touched box, empty nodes included:
//   v = p/m where m > 0, else 0;   v += Δt g
// freeslip: within `bound` nodes of a wall (index < bound, index > n − bound) the normal component
// that points outwards becomes zero; noslip: there and then the whole velocity becomes zero.

#include "ops/kernels/mpm/grid.hpp"
#include "ops/kernels/mpm/node_row.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// −1 near the wall at 0, +1 near the wall at 1, 0 elsewhere.
UNIPHY_INLINE int wall_side(int index, int n, int bound) {
  return index < bound ? -1 : (index > n - bound ? 1 : 0);
}

/// One layer of nodes, in place.
template <class T>
void grid_update(const GridView<T>& grid, int i, const LayerBox& box,
                 const StepConstants<T>& constants) {
  const int side_x = wall_side(i, constants.n, constants.bound);
  for (int j = box.y_begin; j < box.y_end; ++j) {
    const int side_y = wall_side(j, constants.n, constants.bound);
    T* node = node_at(grid, i, j, box.z_begin);
    for (int k = box.z_begin; k < box.z_end; ++k, node += 4) {
      const T inverse = node[3] > 0 ? 1 / node[3] : T(0);
      T v[3];
      for (int a = 0; a < 3; ++a) v[a] = node[a] * inverse + constants.dv[a];
      const int side[3] = {side_x, side_y, wall_side(k, constants.n, constants.bound)};
      bool stuck = false;
      for (int a = 0; a < 3; ++a) {
        const bool clamp = side[a] * v[a] > 0;
        stuck = stuck || clamp;
        if (clamp) v[a] = 0;
      }
      if (stuck && constants.wall == Wall::noslip) v[0] = v[1] = v[2] = 0;
      for (int a = 0; a < 3; ++a) node[a] = v[a];
    }
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
