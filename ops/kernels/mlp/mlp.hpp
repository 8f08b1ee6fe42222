#pragma once

#include <type_traits>

#include "ops/kernels/mlp/activation.hpp"
#include "ops/kernels/mlp/weight_gradient.hpp"

// A multilayer perceptron over a tile of kTile particles, one particle a lane. Activations are
// planes [row, kTile]; the weights stream past accumulators that stay in registers, so that the
// layers run at the FMA rate.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// An output layer, and the first one backwards.
template <class T>
struct AsIs {
  Lanes<T> operator()(const Lanes<T>& v, std::ptrdiff_t) const { return v; }
};

/// out = finish(bias + W in) for one tile: `packed` is [padded(rows) / 4, cols, 4], a null bias is
/// zero, and finish(v, k) is what becomes of the numbers from k on.
template <class T, class Finish>
inline void tile_linear(int rows, int cols, const T* packed, const T* bias, const T* in, T* out,
                        const Finish& finish) {
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
          for (int g = 0; g < kGroup; ++g) sum[o][g] = lane_fma(weight_o, x[g], sum[o][g]);
        }
      }
      for (int o = 0; o < kOutputBlock; ++o)
        for (int g = 0; g < kGroup; ++g)
          sum[o][g].store_aligned(out + std::ptrdiff_t(r + o) * kTile + l + g * w);
      if constexpr (!std::is_same_v<Finish, AsIs<T>>) {
        // A loop, and no work on the sums themselves: with all of them in registers there is no
        // room for what an activation needs.
#pragma GCC unroll 1
        for (int o = 0; o < kOutputBlock; ++o) {
#pragma GCC unroll 4
          for (int g = 0; g < kGroup; ++g) {
            const std::ptrdiff_t at = std::ptrdiff_t(r + o) * kTile + l + g * w;
            finish(V::load_aligned(out + at), at).store_aligned(out + at);
          }
        }
      }
    }
  }
}

/// Backwards through a hidden layer.
template <class T>
struct TimesSlope {
  const T* slope;
  Lanes<T> operator()(const Lanes<T>& v, std::ptrdiff_t at) const {
    return v * Lanes<T>::load_aligned(slope + at);
  }
};
/// A hidden layer; with `keep` the slopes are stored.
template <Activation A, bool keep, class T>
struct Activated {
  T* slope;
  UNIPHY_INLINE Lanes<T> operator()(const Lanes<T>& v, std::ptrdiff_t at) const {
    Lanes<T> d;
    const Lanes<T> y = activate<A>(v, keep ? &d : nullptr);
    if (keep) d.store_aligned(slope + at);
    return y;
  }
};

template <Activation A, bool keep, class T>
UNIPHY_NOINLINE void hidden_layer(const PackedLayer<T>& layer, const T* in, T* out, T* slope) {
  tile_linear(layer.out, layer.in, layer.forward, layer.bias, in, out,
              Activated<A, keep, T>{slope});
}
/// Layer k, its activation included; `slope` is written with `keep`.
template <bool keep, class T>
inline void layer_forward(const PackedMlp<T>& net, int k, const T* in, T* out, T* slope) {
  const PackedLayer<T>& layer = net.layer[k];
  if (k + 1 == net.depth)
    return tile_linear(layer.out, layer.in, layer.forward, layer.bias, in, out, AsIs<T>{});
  switch (net.activation) {
    case Activation::gelu:
      return hidden_layer<Activation::gelu, keep>(layer, in, out, slope);
    case Activation::silu:
      return hidden_layer<Activation::silu, keep>(layer, in, out, slope);
    case Activation::squareplus:
      return hidden_layer<Activation::squareplus, keep>(layer, in, out, slope);
  }
}

/// in [padded(in), kTile] → the returned plane [padded(out), kTile] inside scratch
/// (forward_scratch() numbers).
template <class T>
inline T* mlp_forward(const PackedMlp<T>& net, const T* in, T* scratch) {
  T* buffer[2] = {scratch, scratch + net.max_width * kTile};
  const T* from = in;
  for (int k = 0; k < net.depth; ++k) {
    T* to = buffer[k % 2];
    layer_forward<false, T>(net, k, from, to, nullptr);
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

/// mlp_forward that keeps what mlp_backward needs in `tape` (tape_scratch() numbers). With
/// hidden_only, which is all that mlp_backward asks for, the result is not computed.
template <class T>
inline T* mlp_forward_tape(const PackedMlp<T>& net, const T* in, T* tape,
                           bool hidden_only = false) {
  const T* from = in;
  for (int k = 0; k < (hidden_only ? net.depth - 1 : net.depth); ++k) {
    T* to = tape_value(net, tape, k);
    layer_forward<true>(net, k, from, to, tape_slope(net, tape, k));
    from = to;
  }
  return tape_value(net, tape, net.depth - 1);
}

/// grad_out [padded(out), kTile] → grad_in [padded(in), kTile] (may be null), given the tape of the
/// same tile. What rows of grad_out beyond out() hold does not matter. `first_bias`, if given, has
/// the gradient of the first layer's bias added, [out of layer 0]. `weight_sums`, if given, has the
/// gradients of weights and biases added (PackedMlp::weight_sums, aligned to 64 bytes).
template <class T>
inline void mlp_backward(const PackedMlp<T>& net, const T* in, T* tape, const T* grad_out,
                         T* grad_in, T* first_bias, T* weight_sums) {
  T* buffer[2] = {tape_value(net, tape, net.depth), tape_slope(net, tape, net.depth)};
  const T* grad = grad_out;
  if (weight_sums) weight_sums += net.weight_sums();
  for (int k = net.depth - 1; k >= 0; --k) {
    const PackedLayer<T>& layer = net.layer[k];
    if (weight_sums) {
      weight_sums -= weight_sums_of_layer(layer.in, layer.out);
      const T* from = k == 0 ? in : tape_value(net, tape, k - 1);
      tile_weight_gradient(layer.out, layer.in, grad, from, tape_value(net, tape, net.depth + 1),
                           weight_sums);
    }
    if (k == 0) {
      if (first_bias)
        for (int o = 0; o < layer.out; ++o) first_bias[o] += plane_sum(grad + o * kTile);
      if (grad_in)
        tile_linear<T>(layer.in, layer.out, layer.backward, nullptr, grad, grad_in, AsIs<T>{});
      return;
    }
    T* to = buffer[k % 2];
    tile_linear<T>(layer.in, layer.out, layer.backward, nullptr, grad, to,
                   TimesSlope<T>{tape_slope(net, tape, k - 1)});
    grad = to;
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
