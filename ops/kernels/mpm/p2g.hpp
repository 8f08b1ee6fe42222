#pragma once

// Particle-to-grid transfer, APIC with the MLS-MPM stress (Hu et al., "A moving least squares
// material point method", ACM TOG 37(4), 2018):
//   A   = −Δt V₀ (4/Δx²) τ + m C
//   p_n = Σ_p w_np (m v + A (x_n − x_p)),     m_n = Σ_p w_np m
// Momentum in kg m/s, mass in kg, τ (Kirchhoff stress) in Pa, V₀ in m³, C in 1/s.
//
// Parallel without atomics and with one order of summation: a thread owns whole layers of the grid
// (all nodes of some x indices), walks over all chunks in order and adds only what falls into its
// layers. The sum at a node then runs over the particles in their order, whoever computes it.

#include "ops/kernels/mpm/bspline.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

template <class V, class T>
UNIPHY_INLINE V load_plane(const T* planes, int k, int l) {
  if constexpr (is_scalar_lane<V>) {
    return planes[k * kChunk + l];
  } else {
    return V::load_aligned(planes + k * kChunk + l);
  }
}
template <class V, class T>
UNIPHY_INLINE void store_plane(T* planes, int k, int l, const V& value) {
  if constexpr (is_scalar_lane<V>) {
    planes[k * kChunk + l] = value;
  } else {
    value.store_aligned(planes + k * kChunk + l);
  }
}

/// Writes the records of lanes l … l+width−1: rows q − Σ_b a_b f_b, a_x, a_y, a_z, where a_b[c] is
/// the coefficient of component c in direction b per node index, and the fourth number of the first
/// row is `weight` (the mass in P2G).
template <class V, class T>
UNIPHY_INLINE void store_records(TransferChunk<T>* chunk, int l, const V* q, const V* a,
                                 const V& weight) {
  constexpr int w = width_of<V>;
  alignas(64) T buffer[13][w];
  const auto keep = [&](int row, const V& value) {
    if constexpr (is_scalar_lane<V>) {
      buffer[row][0] = value;
    } else {
      value.store_aligned(buffer[row]);
    }
  };
  V f[3];
  for (int b = 0; b < 3; ++b) f[b] = load_plane<V>(chunk->f[0], b, l);
  for (int c = 0; c < 3; ++c) {
    keep(c, q[c] - (a[3 * c] * f[0] + a[3 * c + 1] * f[1] + a[3 * c + 2] * f[2]));
    for (int b = 0; b < 3; ++b) keep(4 + 3 * b + c, a[3 * c + b]);
  }
  keep(3, weight);
  for (int i = 0; i < w; ++i) {
    T* to = chunk->record[l + i];
    for (int c = 0; c < 4; ++c) to[c] = buffer[c][i];
    for (int b = 0; b < 3; ++b) {
      for (int c = 0; c < 3; ++c) to[4 + 4 * b + c] = buffer[4 + 3 * b + c][i];
      to[7 + 4 * b] = 0;
    }
  }
}

/// The records of P2G from the state planes, the stress planes and the planes of mass and volume.
/// The stencil of the chunk must be there.
template <class T>
void p2g_records(const T* state, const T* tau, const T* mass, const T* volume,
                 const StepConstants<T>& constants, TransferChunk<T>* chunk) {
  using V = Lanes<T>;
  // Offsets are counted in nodes: the coefficients carry one factor Δx.
  const V stress_factor(-constants.dt * 4 * constants.inv_dx), dx(constants.dx);
  for (int l = 0; l < chunk->count; l += width_of<V>) {
    const V m = load_plane<V>(mass, 0, l);
    const V per_tau = stress_factor * load_plane<V>(volume, 0, l);
    const V per_C = m * dx;
    V q[3], a[9];
    for (int c = 0; c < 3; ++c) q[c] = m * load_plane<V>(state, kPlaneV + c, l);
    for (int k = 0; k < 9; ++k) {
      a[k] = per_tau * load_plane<V>(tau, k, l) + per_C * load_plane<V>(state, kPlaneC + k, l);
    }
    store_records(chunk, l, q, a, m);
  }
}

/// Asks for the record of the same lane in the next chunk (prefetch.hpp), which need not exist.
template <class T>
UNIPHY_INLINE void prefetch_record_after(const T* record) {
  __builtin_prefetch(reinterpret_cast<const char*>(record) + sizeof(TransferChunk<T>));
}

/// Particle l's planes of `moments` from sums over the rows of its stencil, not yet weighted along
/// z: Σ w h, then Σ w h i_b for the node offsets i_b (b = x, y, z), `components` numbers of h each.
template <int components, class T>
UNIPHY_INLINE void store_moments(NodeRow<T> sum, const NodeRow<T>& sum_x, const NodeRow<T>& sum_y,
                                 const NodeRow<T>& wz, const NodeRow<T>& index, int l, T* moments) {
  T out[4][4];
  sum = sum * wz;
  sum_nodes(sum, out[0]);
  sum_nodes(sum_x * wz, out[1]);
  sum_nodes(sum_y * wz, out[2]);
  sum_nodes(sum * index, out[3]);
  for (int b = 0; b < 4; ++b) {
    for (int c = 0; c < components; ++c) moments[(components * b + c) * kChunk + l] = out[b][c];
  }
}

/// Adds the chunk to the layers [layer_begin, layer_end) of the grid.
template <class T>
void scatter(const TransferChunk<T>& chunk, const GridView<T>& grid, int layer_begin,
             int layer_end) {
  if (chunk.base_max[0] + 3 <= layer_begin || chunk.base_min[0] >= layer_end) return;
  using Row = NodeRow<T>;
  const std::ptrdiff_t row_stride = grid.row_stride, layer_stride = grid.layer_stride;
  const Row index = row_index<T>();
  for (int l = 0; l < chunk.count; ++l) {
    const int base = chunk.base[0][l];
    const int from = base < layer_begin ? layer_begin - base : 0;
    const int to = base + 3 > layer_end ? layer_end - base : 3;
    if (from >= to) continue;
    T wx[3], wy[3];
    weights3(chunk.f[0][l], wx);
    weights3(chunk.f[1][l], wy);
    const Row wz = row_weights(chunk.f[2][l]);
    const T* record = chunk.record[l];
    prefetch_record_after(record);
    const Row q = lane_fma(index, Row::repeat4(record + 12), Row::repeat4(record)) * wz;
    const Row ax = Row::repeat4(record + 4) * wz;
    const Row ay = Row::repeat4(record + 8) * wz;
    T* layer = node_at(grid, base + from, chunk.base[1][l], chunk.base[2][l]);
    // Not unrolled: one copy of the arithmetic, hence the same bits whether a particle is cut by
    // the border between two threads or not.
#pragma GCC unroll 1
    for (int i = from; i < to; ++i, layer += layer_stride) {
      const Row q_i = wx[i] * lane_fma(T(i), ax, q);
      const Row ay_i = wx[i] * ay;
      for (int j = 0; j < 3; ++j) {
        T* at = layer + j * row_stride;
        lane_fma(wy[j], lane_fma(T(j), ay_i, q_i), Row::load(at)).store(at);
      }
    }
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
