#pragma once

#include <cstddef>

namespace uniphy::kernels {

/// What the walls of the unit cube do to the velocity of the nodes near them, see grid_update.hpp.
enum class Wall {
  freeslip,  ///< the component that points outwards becomes zero
  noslip     ///< the whole velocity becomes zero where freeslip would clamp
};

/// The background grid of the unit cube and the time step: n nodes a side, node (i,j,k) at
/// (i,j,k)/n m, indices 0 … n−1.
struct GridSettings {
  int n = 20;
  double dt = 5e-4;                  ///< s
  double gravity[3] = {0, -9.8, 0};  ///< m/s²
  Wall wall = Wall::freeslip;
  int bound = 3;  ///< thickness of the walls in nodes

  double dx() const { return 1.0 / n; }
  /// Throws Error naming the first member that makes no sense.
  void check() const;
};

/// Four numbers a node: momentum (kg m/s) and mass (kg) after the scatter, velocity (m/s) and mass
/// after the grid update. Nodes of a row (along z) are contiguous. Every row is followed by one
/// node of padding, because the widest vectors read and write four nodes where the stencil has
/// three: (i, j, n) is memory but not part of the grid.
template <class T>
struct GridView {
  T* data = nullptr;
  std::ptrdiff_t row_stride = 0, layer_stride = 0;  ///< from (i,j,k) to (i,j+1,k), (i+1,j,k)
};

/// Numbers that a grid with n nodes a side takes.
constexpr std::ptrdiff_t grid_size(std::ptrdiff_t n) { return n * n * (n + 1) * 4; }

template <class T>
GridView<T> grid_view(T* data, std::ptrdiff_t n) {
  return {data, (n + 1) * 4, n * (n + 1) * 4};
}

/// The touched part [y_begin, y_end) × [z_begin, z_end) of one layer (all nodes with one x index).
struct LayerBox {
  int y_begin = 0, y_end = 0, z_begin = 0, z_end = 0;

  bool empty() const { return y_end <= y_begin; }
  std::ptrdiff_t nodes() const {
    return empty() ? 0 : std::ptrdiff_t(y_end - y_begin) * (z_end - z_begin);
  }
};

/// GridSettings in the element type of the kernels.
template <class T>
struct StepConstants {
  int n;
  T dt, dx, inv_dx;
  T dv[3];  ///< dt times gravity
  Wall wall;
  int bound;

  explicit StepConstants(const GridSettings& s)
      : n(s.n),
        dt(T(s.dt)),
        dx(T(s.dx())),
        inv_dx(T(s.n)),
        dv{T(s.dt * s.gravity[0]), T(s.dt * s.gravity[1]), T(s.dt * s.gravity[2])},
        wall(s.wall),
        bound(s.bound) {}
};

}  // namespace uniphy::kernels
