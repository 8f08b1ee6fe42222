#pragma once

#include "ops/kernels/mpm/p2g.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// For the four numbers h_n of each node (dL/d(momentum), dL/d(mass)) and the records r of the
/// chunk, planes `moments` [19]:
///   0 … 3    Σ w h
///   4 … 15   Σ w h i_b for the node offsets i_b (b = x, y, z; four numbers each)
///   16 … 18  Σ (∂w/∂f_b) h·(q + i a_x + j a_y + k a_z)
/// With slopes_only just the last three planes are written.
template <bool slopes_only, class T>
void gather_adjoint(const TransferChunk<T>& chunk, const GridView<const T>& grid, T* moments) {
  using Row = NodeRow<T>;
  const std::ptrdiff_t row_stride = grid.row_stride, layer_stride = grid.layer_stride;
  const Row index = row_index<T>();
  for (int l = 0; l < chunk.count; ++l) {
    T wx[3], wy[3], dx[3], dy[3];
    weights3(chunk.f[0][l], wx);
    weights3(chunk.f[1][l], wy);
    weight_slopes3(chunk.f[0][l], dx);
    weight_slopes3(chunk.f[1][l], dy);
    const Row wz = row_weights(chunk.f[2][l]);
    const T* record = chunk.record[l];
    if (slopes_only) prefetch_record_after(record);
    const Row q = lane_fma(index, Row::repeat4(record + 12), Row::repeat4(record));
    const Row ax = Row::repeat4(record + 4), ay = Row::repeat4(record + 8);
    const T* layer = node_at(grid, chunk.base[0][l], chunk.base[1][l], chunk.base[2][l]);
    Row sum = Row::zero(), sum_x = Row::zero(), sum_y = Row::zero();
    Row work = Row::zero(), work_x = Row::zero(), work_y = Row::zero();
    for (int i = 0; i < 3; ++i, layer += layer_stride) {
      const Row q_i = lane_fma(T(i), ax, q);
      Row along = Row::zero(), along_slope = Row::zero();
      Row part[3];
      for (int j = 0; j < 3; ++j) {
        const Row h = Row::load(layer + j * row_stride);
        const Row product = h * lane_fma(T(j), ay, q_i);
        along = lane_fma(wy[j], product, along);
        along_slope = lane_fma(dy[j], product, along_slope);
        if (!slopes_only) part[j] = wy[j] * h;
      }
      work = lane_fma(wx[i], along, work);
      work_x = lane_fma(dx[i], along, work_x);
      work_y = lane_fma(wx[i], along_slope, work_y);
      if (!slopes_only) {
        const Row along_y = part[0] + (part[1] + part[2]);
        sum = lane_fma(wx[i], along_y, sum);
        if (i > 0) sum_x = lane_fma(T(i) * wx[i], along_y, sum_x);
        sum_y = lane_fma(wx[i], lane_fma(T(2), part[2], part[1]), sum_y);
      }
    }
    const Row slope_z = row_weight_slopes(chunk.f[2][l]);
    moments[16 * kChunk + l] = sum_all(work_x * wz);
    moments[17 * kChunk + l] = sum_all(work_y * wz);
    moments[18 * kChunk + l] = sum_all(work * slope_z);
    if (!slopes_only) store_moments<4>(sum, sum_x, sum_y, wz, index, l, moments);
  }
}

/// The adjoint of P2G at the particles, from the moments of gather_adjoint and the P2G records of
/// the chunk. `grad` are state planes: x and C are added to, v is overwritten. grad_tau [9] planes
/// are overwritten.
template <class T>
void p2g_adjoint_finish(const TransferChunk<T>& chunk, const T* moments, const T* mass,
                        const T* volume, const StepConstants<T>& constants, T* grad, T* grad_tau) {
  using V = Lanes<T>;
  const V stress_factor(-constants.dt * 4 * constants.inv_dx), dx(constants.dx),
      inv_dx(constants.inv_dx);
  constexpr int w = width_of<V>;
  for (int l = 0; l < chunk.count; l += w) {
    const V m = load_plane<V>(mass, 0, l);
    const V per_tau = stress_factor * load_plane<V>(volume, 0, l);
    V g_q[3];
    for (int c = 0; c < 3; ++c) {
      g_q[c] = load_plane<V>(moments, c, l);
      store_plane<V>(grad, kPlaneV + c, l, m * g_q[c]);
    }
    for (int b = 0; b < 3; ++b) {
      const V f = load_plane<V>(chunk.f[0], b, l);
      alignas(64) T a[3][w];  // column b of the coefficients, from the records
      for (int c = 0; c < 3; ++c) {
        for (int i = 0; i < w; ++i) a[c][i] = chunk.record[l + i][4 + 4 * b + c];
      }
      V g_f = load_plane<V>(moments, 16 + b, l);
      for (int c = 0; c < 3; ++c) {
        V a_c;
        if constexpr (is_scalar_lane<V>) {
          a_c = a[c][0];
        } else {
          a_c = V::load_aligned(a[c]);
        }
        g_f -= a_c * g_q[c];
        const V g_a = load_plane<V>(moments, 4 + 4 * b + c, l) - f * g_q[c];
        store_plane<V>(grad_tau, 3 * c + b, l, per_tau * g_a);
        const int k = kPlaneC + 3 * c + b;
        store_plane<V>(grad, k, l, lane_fma(m * dx, g_a, load_plane<V>(grad, k, l)));
      }
      const int k = kPlaneX + b;
      store_plane<V>(grad, k, l, lane_fma(g_f, inv_dx, load_plane<V>(grad, k, l)));
    }
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
