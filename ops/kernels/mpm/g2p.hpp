#pragma once

// Grid-to-particle transfer, APIC (Jiang et al., "The affine particle-in-cell method", ACM TOG
// 34(4), 2015), and the new positions:
//   v = Σ_n w_n v_n,   C = (4/Δx²) Σ_n w_n v_n (x_n − x_p)ᵀ,   x ← x + Δt v
// v in m/s, C in 1/s, x in m.

#include "ops/kernels/mpm/p2g.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Planes `moments` [12]: Σ w v_n, then Σ w v_n i_b for the node offsets i_b (b = x, y, z; three
/// components each).
template <class T>
void gather(const TransferChunk<T>& chunk, const GridView<const T>& grid, T* moments) {
  using Row = NodeRow<T>;
  const std::ptrdiff_t row_stride = grid.row_stride, layer_stride = grid.layer_stride;
  const Row index = row_index<T>();
  for (int l = 0; l < chunk.count; ++l) {
    T wx[3], wy[3];
    weights3(chunk.f[0][l], wx);
    weights3(chunk.f[1][l], wy);
    const Row wz = row_weights(chunk.f[2][l]);
    const T* layer = node_at(grid, chunk.base[0][l], chunk.base[1][l], chunk.base[2][l]);
    Row sum = Row::zero(), sum_x = Row::zero(), sum_y = Row::zero();
    for (int i = 0; i < 3; ++i, layer += layer_stride) {
      const Row row0 = Row::load(layer), row1 = Row::load(layer + row_stride),
                row2 = Row::load(layer + 2 * row_stride);
      const Row part1 = wy[1] * row1, part2 = wy[2] * row2;
      const Row along_y = lane_fma(wy[0], row0, part1 + part2);
      sum = lane_fma(wx[i], along_y, sum);
      if (i > 0) sum_x = lane_fma(T(i) * wx[i], along_y, sum_x);
      sum_y = lane_fma(wx[i], lane_fma(T(2), part2, part1), sum_y);
    }
    store_moments<3>(sum, sum_x, sum_y, wz, index, l, moments);
  }
}

/// x, v and C of `state_out` from the moments; x is advanced from `state`, which may be the same.
template <class T>
void g2p_finish(const TransferChunk<T>& chunk, const T* moments, const T* state,
                const StepConstants<T>& constants, T* state_out) {
  using V = Lanes<T>;
  const V dt(constants.dt), factor(4 * constants.inv_dx);
  for (int l = 0; l < chunk.count; l += width_of<V>) {
    for (int c = 0; c < 3; ++c) {
      const V v = load_plane<V>(moments, c, l);
      store_plane<V>(state_out, kPlaneV + c, l, v);
      store_plane<V>(state_out, kPlaneX + c, l,
                     lane_fma(dt, v, load_plane<V>(state, kPlaneX + c, l)));
      for (int b = 0; b < 3; ++b) {
        const V f = load_plane<V>(chunk.f[0], b, l);
        store_plane<V>(state_out, kPlaneC + 3 * c + b, l,
                       factor * (load_plane<V>(moments, 3 + 3 * b + c, l) - f * v));
      }
    }
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
