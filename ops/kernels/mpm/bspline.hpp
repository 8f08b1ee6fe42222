#pragma once

// The quadratic B-spline of MPM and its stencil (Jiang et al., "The material point method for
// simulating continuum materials", SIGGRAPH 2016 course notes, eq. 123). With the base node
//   b = floor(x/Δx − 1/2),   f = x/Δx − b in [1/2, 3/2)
// the weights of the nodes b, b+1, b+2 and their derivatives by f are
//   w  = [ (3/2 − f)²/2, 3/4 − (f − 1)², (f − 1/2)²/2 ]
//   w' = [ f − 3/2,      −2 (f − 1),     f − 1/2      ]
// written below as w = t + s (f − c)², w' = 2 s (f − c), which never turns negative by rounding.
// They are continuous with one continuous derivative, so the adjoints have no kinks here.

#include "ops/kernels/mpm/grid.hpp"
#include "ops/kernels/mpm/node_row.hpp"
#include "ops/kernels/mpm/particle_chunk.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

template <class T>
struct BSplineTable {
  // One entry for each number of a node row; zero weight for the fourth node.
  alignas(64) static constexpr T s[16] = {T(0.5), T(0.5), T(0.5), T(0.5), -1, -1, -1, -1,
                                          T(0.5), T(0.5), T(0.5), T(0.5), 0,  0,  0,  0};
  alignas(64) static constexpr T c[16] = {T(1.5), T(1.5), T(1.5), T(1.5), 1, 1, 1, 1,
                                          T(0.5), T(0.5), T(0.5), T(0.5), 0, 0, 0, 0};
  alignas(64) static constexpr T t[16] = {0, 0, 0, 0, T(0.75), T(0.75), T(0.75), T(0.75),
                                          0, 0, 0, 0, 0,       0,       0,       0};
  alignas(64) static constexpr T k[16] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 0, 0, 0, 0};
};

/// The index k of each node of a row, as a multiplier.
template <class T>
UNIPHY_INLINE NodeRow<T> row_index() {
  return NodeRow<T>::load(BSplineTable<T>::k);
}

/// The three weights along the row, each repeated for the four numbers of a node.
template <class T>
UNIPHY_INLINE NodeRow<T> row_weights(T f) {
  const NodeRow<T> d = f - NodeRow<T>::load(BSplineTable<T>::c);
  return lane_fma(NodeRow<T>::load(BSplineTable<T>::s), d * d,
                  NodeRow<T>::load(BSplineTable<T>::t));
}

/// Their derivatives by f.
template <class T>
UNIPHY_INLINE NodeRow<T> row_weight_slopes(T f) {
  const NodeRow<T> d = f - NodeRow<T>::load(BSplineTable<T>::c);
  return T(2) * (NodeRow<T>::load(BSplineTable<T>::s) * d);
}

template <class T>
UNIPHY_INLINE void weights3(T f, T* w) {
  w[0] = T(0.5) * (T(1.5) - f) * (T(1.5) - f);
  w[1] = T(0.75) - (f - 1) * (f - 1);
  w[2] = T(0.5) * (f - T(0.5)) * (f - T(0.5));
}

template <class T>
UNIPHY_INLINE void weight_slopes3(T f, T* d) {
  d[0] = f - T(1.5);
  d[1] = -2 * (f - 1);
  d[2] = f - T(0.5);
}

/// Fills f, base, their bounds and `bad` of a chunk from its position planes. A stencil that leaves
/// the grid, or a position that is not finite, is reported in `bad` and replaced by a harmless one.
template <class T>
void stencil(const T* x, int count, const StepConstants<T>& constants, TransferChunk<T>* chunk) {
  const T last = T(constants.n - 3);
  chunk->count = count;
  int bad = count;
  for (int a = 0; a < 3; ++a) {
    const T* xa = x + a * kChunk;
    int lowest = constants.n, highest = 0;
    for (int l = 0; l < count; ++l) {
      const T scaled = xa[l] * constants.inv_dx;
      const T shifted = scaled - T(0.5);
      const bool inside = shifted >= 0 && shifted < last + 1;  // false for NaN as well
      const int base = static_cast<int>(inside ? shifted : T(0));
      chunk->base[a][l] = base;
      chunk->f[a][l] = inside ? scaled - T(base) : T(1);
      lowest = base < lowest ? base : lowest;
      highest = base > highest ? base : highest;
      bad = !inside && l < bad ? l : bad;
    }
    chunk->base_min[a] = lowest;
    chunk->base_max[a] = highest;
  }
  chunk->bad = bad < count ? bad : -1;
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
