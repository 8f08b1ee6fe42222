#pragma once

#include "ops/kernels/activation.hpp"
#include "ops/kernels/learned_law_table.hpp"

// A multilayer perceptron over a tile of kTile particles, one particle a lane. Activations are
// planes [row, kTile]; the weights stream past accumulators that stay in registers, so that the
// layers run at the FMA rate.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// out = bias + W in for one tile: `packed` is [padded(rows) / 4, cols, 4]. A null bias is zero.
template <class T>
inline void tile_linear(int rows, int cols, const T* packed, const T* bias, const T* in, T* out) {
  using V = Lanes<T>;
  constexpr int w = width_of<V>;
  // Four vectors of a 32-register file, two of a 16-register one.
  constexpr int kGroup = w * sizeof(T) >= 64 ? 4 : 2;
  for (std::ptrdiff_t l = 0; l < kTile; l += kGroup * w) {
    for (int r = 0; r < rows; r += kOutputBlock) {
      const T* weight = packed + std::ptrdiff_t(r) * cols;
      V sum[kOutputBlock][kGroup];
      for (int o = 0; o < kOutputBlock; ++o)
        for (int g = 0; g < kGroup; ++g) sum[o][g] = V(bias ? bias[r + o] : T(0));
      for (int c = 0; c < cols; ++c) {
        V x[kGroup];
        for (int g = 0; g < kGroup; ++g) x[g] = V::load_aligned(in + c * kTile + l + g * w);
        for (int o = 0; o < kOutputBlock; ++o) {
          const V weight_o(weight[c * kOutputBlock + o]);
          for (int g = 0; g < kGroup; ++g) sum[o][g] = fma(weight_o, x[g], sum[o][g]);
        }
      }
      for (int o = 0; o < kOutputBlock; ++o)
        for (int g = 0; g < kGroup; ++g)
          sum[o][g].store_aligned(out + std::ptrdiff_t(r + o) * kTile + l + g * w);
    }
  }
}

template <Activation A, class T>
inline void tile_activate(int rows, T* value, T* slope) {
  using V = Lanes<T>;
  for (std::ptrdiff_t k = 0; k < rows * kTile; k += width_of<V>) {
    V d;
    const V y = activate<A>(V::load_aligned(value + k), slope ? &d : nullptr);
    y.store_aligned(value + k);
    if (slope) d.store_aligned(slope + k);
  }
}

template <class T>
inline void tile_activate(Activation a, int rows, T* value, T* slope) {
  switch (a) {
    case Activation::gelu:
      return tile_activate<Activation::gelu>(rows, value, slope);
    case Activation::silu:
      return tile_activate<Activation::silu>(rows, value, slope);
    case Activation::squareplus:
      return tile_activate<Activation::squareplus>(rows, value, slope);
  }
}

/// in [padded(in), kTile] → the returned plane [padded(out), kTile] inside scratch
/// (forward_scratch() numbers).
template <class T>
inline T* mlp_forward(const PackedMlp<T>& net, const T* in, T* scratch) {
  T* buffer[2] = {scratch, scratch + net.max_width * kTile};
  const T* from = in;
  for (int k = 0; k < net.depth; ++k) {
    const PackedLayer<T>& layer = net.layer[k];
    T* to = buffer[k % 2];
    tile_linear(layer.out, layer.in, layer.forward, layer.bias, from, to);
    if (k + 1 < net.depth) tile_activate<T>(net.activation, layer.out, to, nullptr);
    from = to;
  }
  return buffer[(net.depth - 1) % 2];
}

/// Where a tape keeps the plane of layer k: its output value (k = depth − 1: the result), and the
/// slope of its activation.
template <class T>
UNIPHY_INLINE T* tape_value(const PackedMlp<T>& net, T* tape, int k) {
  return tape + std::ptrdiff_t(2 * k) * net.max_width * kTile;
}
template <class T>
UNIPHY_INLINE T* tape_slope(const PackedMlp<T>& net, T* tape, int k) {
  return tape + std::ptrdiff_t(2 * k + 1) * net.max_width * kTile;
}

/// mlp_forward that keeps what mlp_backward needs in `tape` (tape_scratch() numbers).
template <class T>
inline T* mlp_forward_tape(const PackedMlp<T>& net, const T* in, T* tape) {
  const T* from = in;
  for (int k = 0; k < net.depth; ++k) {
    const PackedLayer<T>& layer = net.layer[k];
    T* to = tape_value(net, tape, k);
    tile_linear(layer.out, layer.in, layer.forward, layer.bias, from, to);
    if (k + 1 < net.depth) tile_activate(net.activation, layer.out, to, tape_slope(net, tape, k));
    from = to;
  }
  return tape_value(net, tape, net.depth - 1);
}

template <class T>
UNIPHY_INLINE T plane_sum(const T* plane) {
  using V = Lanes<T>;
  V sum = V::load_aligned(plane);
  for (std::ptrdiff_t l = width_of<V>; l < kTile; l += width_of<V>)
    sum = sum + V::load_aligned(plane + l);
  return lane_sum(sum);
}

/// Adds the gradients of one layer's weight and bias. Blocks of them stay in registers over a tile;
/// rows of the last blocks beyond `out` and `in` are read but count for nothing.
template <class T>
inline void tile_weight_gradient(int out, int in, const T* grad, const T* from,
                                 const WeightGradient<T>& to) {
  using V = Lanes<T>;
  constexpr int w = width_of<V>;
  // 16 sums of a 32-register file, 8 of a 16-register one.
  constexpr int kOut = w * sizeof(T) >= 64 ? 4 : 2, kIn = 4;
  for (int o = 0; o < out; o += kOut) {
    for (int i = 0; i < in; i += kIn) {
      V sum[kOut * kIn];
      for (V& s : sum) s = V(T(0));
      for (std::ptrdiff_t l = 0; l < kTile; l += w) {
        V x[kIn];
        for (int b = 0; b < kIn; ++b) x[b] = V::load_aligned(from + (i + b) * kTile + l);
        for (int a = 0; a < kOut; ++a) {
          const V g = V::load_aligned(grad + (o + a) * kTile + l);
          for (int b = 0; b < kIn; ++b) sum[a * kIn + b] = fma(g, x[b], sum[a * kIn + b]);
        }
      }
      for (int a = 0; a < kOut && o + a < out; ++a)
        for (int b = 0; b < kIn && i + b < in; ++b)
          to.weight[(o + a) * in + i + b] += quick_lane_sum(sum[a * kIn + b]);
    }
    for (int a = 0; a < kOut && o + a < out; ++a)
      to.bias[o + a] += plane_sum(grad + (o + a) * kTile);
  }
}

/// grad_out [padded(out), kTile] → grad_in [padded(in), kTile] (may be null), given the tape of the
/// same tile. What rows of grad_out beyond out() hold does not matter. `first_bias`, if given, has
/// the gradient of the first layer's bias added, [out of layer 0]. `weights`, if given, has one
/// entry a layer; gradients of weights and biases are added to it.
template <class T>
inline void mlp_backward(const PackedMlp<T>& net, const T* in, T* tape, const T* grad_out,
                         T* grad_in, T* first_bias, const WeightGradient<T>* weights) {
  using V = Lanes<T>;
  constexpr int w = width_of<V>;
  T* buffer[2] = {tape_value(net, tape, net.depth), tape_slope(net, tape, net.depth)};
  const T* grad = grad_out;
  for (int k = net.depth - 1; k >= 0; --k) {
    const PackedLayer<T>& layer = net.layer[k];
    if (weights) {
      const T* from = k == 0 ? in : tape_value(net, tape, k - 1);
      tile_weight_gradient(layer.out, layer.in, grad, from, weights[k]);
    }
    if (k == 0) {
      if (first_bias)
        for (int o = 0; o < layer.out; ++o) first_bias[o] += plane_sum(grad + o * kTile);
      if (grad_in) tile_linear<T>(layer.in, layer.out, layer.backward, nullptr, grad, grad_in);
      return;
    }
    T* to = buffer[k % 2];
    tile_linear<T>(layer.in, layer.out, layer.backward, nullptr, grad, to);
    const T* slope = tape_slope(net, tape, k - 1);
    for (std::ptrdiff_t n = 0; n < layer.in * kTile; n += w)
      (V::load_aligned(to + n) * V::load_aligned(slope + n)).store_aligned(to + n);
    grad = to;
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
