#pragma once

#include <torch/types.h>

#include <algorithm>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "ops/kernels/mlp/packed_mlp.hpp"

// How the op of mlp.hpp cuts its samples into tiles of the kernels.

namespace uniphy::ops {

using kernels::kTile;

/// The network, from the weights and biases of all layers one after the other in one tensor
/// (autograd's Function takes tensors, not lists of them) and the widths that cut it up; and the
/// samples it sees, `per_code` for each code z, in tiles of kTile. z is folded into the bias of the
/// first layer. The numbers are borrowed, the packed ones owned.
template <class T>
class MlpProblem {
 public:
  MlpProblem(std::int64_t codes, std::int64_t per_code, std::int64_t latent, const T* flat,
             const std::vector<std::int64_t>& widths, kernels::Activation activation)
      : codes(codes),
        per_code(per_code),
        latent(latent),
        tiles_per_code((per_code + kTile - 1) / kTile),
        weight(flat),
        packed_(weights(widths), activation, int(latent)) {}

  const kernels::PackedMlpStorage<T>& packed() const { return packed_; }
  const kernels::PackedMlp<T>& net() const { return packed_.mlp(); }
  std::int64_t tiles() const { return codes * tiles_per_code; }
  std::int64_t first_width() const { return net().layer[0].out; }
  std::int64_t in() const { return net().in() + latent; }
  std::int64_t code(std::int64_t tile) const { return tile / tiles_per_code; }
  /// The first of the tile's samples among those of its code, and how many they are.
  std::int64_t first(std::int64_t tile) const { return tile % tiles_per_code * kTile; }
  std::int64_t count(std::int64_t tile) const {
    return std::min<std::int64_t>(kTile, per_code - first(tile));
  }
  /// Element (o, k) of the part of the first weight that takes z.
  const T* latent_weight(std::int64_t o) const { return weight + o * in() + net().in(); }

  const std::int64_t codes, per_code, latent, tiles_per_code;
  const T* const weight;

 private:
  kernels::MlpWeights weights(const std::vector<std::int64_t>& widths) const {
    kernels::MlpWeights all;
    const T* at = weight;
    for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
      const std::int64_t in = widths[k], out = widths[k + 1];
      kernels::MlpWeights::Layer layer{int(in), int(out), {at, at + in * out}, {}};
      at += in * out;
      layer.bias.assign(at, at + out);
      at += out;
      all.layers.push_back(std::move(layer));
    }
    return all;
  }

  kernels::PackedMlpStorage<T> packed_;
};

/// A thread's own network, whose first bias is that of one code.
template <class T>
class MlpOfCode {
 public:
  explicit MlpOfCode(const MlpProblem<T>& problem)
      : problem_(problem),
        layers_(problem.net().layer, problem.net().layer + problem.net().depth),
        bias_(layers_[0].bias, layers_[0].bias + kernels::padded(layers_[0].out)),
        net_(problem.net()) {
    layers_[0].bias = bias_.data();
    net_.layer = layers_.data();
  }
  const kernels::PackedMlp<T>& of_code(const T* z) {
    for (std::int64_t o = 0; o < problem_.first_width(); ++o) {
      T b = problem_.net().layer[0].bias[o];
      const T* w = problem_.latent_weight(o);
      for (std::int64_t k = 0; k < problem_.latent; ++k) b += w[k] * z[k];
      bias_[o] = b;
    }
    return net_;
  }

 private:
  const MlpProblem<T>& problem_;
  std::vector<kernels::PackedLayer<T>> layers_;
  std::vector<T> bias_;
  kernels::PackedMlp<T> net_;
};

/// Samples [codes, per_code, numbers] in any order of memory.
template <class T>
struct SamplesView {
  T* data;
  std::int64_t code_stride, sample_stride, number_stride;

  SamplesView(const torch::Tensor& t)
      : data(t.defined() ? t.data_ptr<std::remove_const_t<T>>() : nullptr),
        code_stride(t.defined() ? t.stride(0) : 0),
        sample_stride(t.defined() ? t.stride(1) : 0),
        number_stride(t.defined() ? t.stride(2) : 0) {}
  /// From the first sample of a tile on.
  T* at(const MlpProblem<std::remove_const_t<T>>& problem, std::int64_t tile) const {
    return data + problem.code(tile) * code_stride + problem.first(tile) * sample_stride;
  }
};

/// The samples of tile t as planes [rows, kTile]; what is missing is zero.
template <class T>
void to_tile(const MlpProblem<T>& problem, const SamplesView<const T>& samples, std::int64_t t,
             std::int64_t rows, T* tile) {
  const T* from = samples.at(problem, t);
  const std::int64_t count = problem.count(t), stride = samples.sample_stride;
  for (std::int64_t r = 0; r < rows; ++r, from += samples.number_stride, tile += kTile) {
    if (stride == 1) {
      std::copy_n(from, count, tile);
    } else {
      for (std::int64_t l = 0; l < count; ++l) tile[l] = from[l * stride];
    }
    std::fill(tile + count, tile + kTile, T(0));
  }
}
template <class T>
void from_tile(const MlpProblem<T>& problem, const T* tile, std::int64_t t, std::int64_t rows,
               const SamplesView<T>& samples) {
  T* to = samples.at(problem, t);
  const std::int64_t count = problem.count(t), stride = samples.sample_stride;
  for (std::int64_t r = 0; r < rows; ++r, to += samples.number_stride, tile += kTile) {
    if (stride == 1) {
      std::copy_n(tile, count, to);
    } else {
      for (std::int64_t l = 0; l < count; ++l) to[l * stride] = tile[l];
    }
  }
}

}  // namespace uniphy::ops
