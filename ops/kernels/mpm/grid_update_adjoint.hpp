#pragma once

#include "ops/kernels/mpm/grid_update.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// The adjoint of grid_update on one layer. `grid` holds what the update left there (velocity and
/// mass), `grad` holds dL/dv and is overwritten with (dL/d(momentum), dL/d(mass)):
///   dL/dp = g/m,   dL/dm = −g·(p/m)/m   where m > 0, else 0,
/// with g = dL/dv but 0 in components that a wall made zero (also the subgradient at the kink).
template <class T>
void grid_update_adjoint(const GridView<const T>& grid, const GridView<T>& grad, int i,
                         const LayerBox& box, const StepConstants<T>& constants) {
  const int side_x = wall_side(i, constants.n, constants.bound);
  for (int j = box.y_begin; j < box.y_end; ++j) {
    const int side_y = wall_side(j, constants.n, constants.bound);
    const T* node = node_at(grid, i, j, box.z_begin);
    T* g = node_at(grad, i, j, box.z_begin);
    for (int k = box.z_begin; k < box.z_end; ++k, node += 4, g += 4) {
      const T inverse = node[3] > 0 ? 1 / node[3] : T(0);
      const int side[3] = {side_x, side_y, wall_side(k, constants.n, constants.bound)};
      const bool near_wall = side[0] != 0 || side[1] != 0 || side[2] != 0;
      const bool stuck = constants.wall == Wall::noslip && near_wall && node[0] == 0 &&
                         node[1] == 0 && node[2] == 0;
      T along = 0;
      for (int a = 0; a < 3; ++a) {
        const bool clamped = stuck || (side[a] != 0 && node[a] == 0);
        const T g_p = clamped ? T(0) : g[a] * inverse;
        along += g_p * (node[a] - constants.dv[a]);
        g[a] = g_p;
      }
      g[3] = -along;
    }
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
