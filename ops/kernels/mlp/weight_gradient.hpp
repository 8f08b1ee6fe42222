#pragma once

#include "ops/kernels/mlp/packed_mlp.hpp"
#include "ops/kernels/simd/transpose4.hpp"

// The gradients of a layer's weight and bias over a tile: dL/dW += g xᵀ summed over the particles,
// g [out, kTile] the gradient of what the layer gives, x [in, kTile] what it takes. With x turned
// round, a lane is an input: sums stay in registers over the tile and none runs across lanes.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

template <class T>
UNIPHY_INLINE T plane_sum(const T* plane) {
  using V = Lanes<T>;
  V sum = V::load_aligned(plane);
  for (std::ptrdiff_t l = width_of<V>; l < kTile; l += width_of<V>)
    sum = sum + V::load_aligned(plane + l);
  return quick_lane_sum(sum);
}

/// Planes [padded(rows), kTile] → [kTile, stride], by squares of four.
template <class T>
inline void transpose_planes(int rows, const T* planes, std::ptrdiff_t stride, T* to) {
  for (int r = 0; r < rows; r += 4) {
    for (std::ptrdiff_t l = 0; l < kTile; l += 4) {
      const T* at = planes + r * kTile + l;
      transpose4<T>({at, at + kTile, at + 2 * kTile, at + 3 * kTile}, to + l * stride + r, stride);
    }
  }
}

/// Adds g xᵀ for kOut rows of g and kVectors vectors of inputs; x is [kTile, stride].
template <int kOut, int kVectors, class T>
inline void add_outer_products(const T* g, const T* x, std::ptrdiff_t stride, T* weight) {
  using V = Lanes<T>;
  constexpr int w = width_of<V>;
  V sum[kOut][kVectors];
  for (int o = 0; o < kOut; ++o)
    for (int v = 0; v < kVectors; ++v) sum[o][v] = V::load_aligned(weight + o * stride + v * w);
  for (std::ptrdiff_t l = 0; l < kTile; ++l) {
    V of_x[kVectors];
    for (int v = 0; v < kVectors; ++v) of_x[v] = V::load_aligned(x + l * stride + v * w);
    for (int o = 0; o < kOut; ++o) {
      const V of_g(g[o * kTile + l]);
      for (int v = 0; v < kVectors; ++v) sum[o][v] = lane_fma(of_g, of_x[v], sum[o][v]);
    }
  }
  for (int o = 0; o < kOut; ++o)
    for (int v = 0; v < kVectors; ++v) sum[o][v].store_aligned(weight + o * stride + v * w);
}

/// Adds the gradients of one layer's weight and bias. What rows of g beyond `out` and of x beyond
/// `in` hold does not matter. sums: weight_sums_of_layer(in, out) numbers, aligned to 64 bytes;
/// turned: [kTile, weight_stride(in)], scratch.
template <class T>
inline void tile_weight_gradient(int out, int in, const T* g, const T* x, T* turned, T* sums) {
  constexpr int w = width_of<Lanes<T>>;
  // 16 sums of a 32-register file, 8 of a 16-register one.
  constexpr int kOut = w * sizeof(T) >= 64 ? 8 : 4;
  const std::ptrdiff_t stride = weight_stride(in);
  transpose_planes(in, x, stride, turned);
  const int vectors = (in + w - 1) / w;
  for (int o = 0; o < out; o += kOut) {
    const T* g_o = g + o * kTile;
    T* weight = sums + o * stride;
    const bool all = padded(out) - o >= kOut;  // else one block of four rows is left
    for (int v = 0; v < vectors; v += 2) {
      const bool both = v + 1 < vectors;
      const auto add = all ? both ? add_outer_products<kOut, 2, T> : add_outer_products<kOut, 1, T>
                       : both ? add_outer_products<4, 2, T>
                              : add_outer_products<4, 1, T>;
      add(g_o, turned + v * w, stride, weight + v * w);
    }
  }
  T* bias = sums + padded(out) * stride;
  for (int o = 0; o < out; ++o) bias[o] += plane_sum(g + o * kTile);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
