#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "ops/kernels/laws/law.hpp"

namespace uniphy::kernels {

/// Particles that one pass of a network handles: activations of a tile stay in the cache.
inline constexpr std::ptrdiff_t kTile = kLawChunk;
/// Outputs that are computed together; packed rows are padded with zeros to a multiple of it.
inline constexpr int kOutputBlock = 4;

constexpr int padded(int n) { return (n + kOutputBlock - 1) / kOutputBlock * kOutputBlock; }

/// Rows of a weight's gradient are padded to whole vectors of any instruction set.
constexpr std::ptrdiff_t weight_stride(int in) { return (in + 15) / 16 * 16; }
/// Numbers of the running sum of a layer's gradients: of the weight, [padded(out),
/// weight_stride(in)], then of the bias, [out] in weight_stride(out) numbers.
constexpr std::ptrdiff_t weight_sums_of_layer(int in, int out) {
  return padded(out) * weight_stride(in) + weight_stride(out);
}

/// One layer as the kernels read it. All pointers are borrowed.
template <class T>
struct PackedLayer {
  int in;
  int out;
  const T* forward;   ///< [padded(out) / 4, in, 4]
  const T* backward;  ///< [padded(in) / 4, out, 4], the transposed weight
  const T* bias;      ///< [padded(out)]
};

/// A network as the kernels read it.
template <class T>
struct PackedMlp {
  int depth;  ///< layers, the linear output layer included
  const PackedLayer<T>* layer;
  Activation activation;
  int max_width;  ///< the largest padded row count of any layer's input or output

  int in() const { return layer[0].in; }
  int out() const { return layer[depth - 1].out; }
  /// Scratch numbers for mlp_forward: two activation buffers.
  std::ptrdiff_t forward_scratch() const { return 2 * std::ptrdiff_t(max_width) * kTile; }
  /// Scratch numbers for mlp_forward_tape + mlp_backward: values and slopes of each hidden layer,
  /// two gradient buffers, and what a layer takes with particles and inputs exchanged.
  std::ptrdiff_t tape_scratch() const {
    return (2 * std::ptrdiff_t(depth + 1) * max_width + weight_stride(max_width)) * kTile;
  }
  /// Numbers of a running sum of the gradients of all weights and biases, layer after layer
  /// (weight_sums_of_layer), but for the part of the first weight that takes the latent.
  std::ptrdiff_t weight_sums() const {
    std::ptrdiff_t size = 0;
    for (int k = 0; k < depth; ++k) size += weight_sums_of_layer(layer[k].in, layer[k].out);
    return size;
  }
};

/// Owns the packed numbers of a network whose first layer takes [features, z]: packed once, for
/// every z.
template <class T>
class PackedMlpStorage {
 public:
  PackedMlpStorage(const MlpWeights& weights, Activation activation, int latent_size);
  PackedMlpStorage(const PackedMlpStorage&) = delete;
  PackedMlpStorage& operator=(const PackedMlpStorage&) = delete;

  /// The network of the features, as it is where z = 0.
  const PackedMlp<T>& mlp() const { return mlp_; }
  int latent_size() const { return latent_size_; }
  /// What z makes of the first bias: b + W_z z, [padded(out of layer 0)].
  std::vector<T> folded_bias(const std::vector<double>& z) const;
  /// Adds W_zᵀ g to z_gradient, g being the gradient of the folded bias [out of layer 0].
  void add_latent_gradient(const T* bias_gradient, std::vector<double>& z_gradient) const;

  /// Weights and biases of all layers, z's part of the first included.
  std::ptrdiff_t weight_size() const;
  /// Adds a running sum (PackedMlp::weight_sums) to a gradient of weight_size() numbers, of each
  /// layer the weight [out, in], row-major, then the bias. The latent's part of the first weight is
  /// left out.
  void add_weight_gradient(const T* sums, T* gradient) const;

 private:
  std::vector<std::vector<T>> numbers_;
  std::vector<PackedLayer<T>> layers_;
  std::vector<double> first_bias_;     // [out of layer 0]
  std::vector<double> latent_weight_;  // [out of layer 0, latent]
  int latent_size_ = 0;
  PackedMlp<T> mlp_{};
};

/// A packed network with one z folded into its first bias; all else is shared.
template <class T>
class FoldedMlp {
 public:
  FoldedMlp(std::shared_ptr<const PackedMlpStorage<T>> packed, std::vector<double> z);
  FoldedMlp(const FoldedMlp&) = delete;
  FoldedMlp& operator=(const FoldedMlp&) = delete;

  const PackedMlp<T>& mlp() const { return mlp_; }
  const PackedMlpStorage<T>& packed() const { return *packed_; }
  /// PackedMlpStorage::add_weight_gradient with the latent's part of the first weight, g zᵀ, g
  /// being the gradient of the first bias.
  void add_weight_gradient(const T* sums, T* gradient) const;

 private:
  std::shared_ptr<const PackedMlpStorage<T>> packed_;
  std::vector<double> z_;
  std::vector<T> bias_;
  std::vector<PackedLayer<T>> layers_;
  PackedMlp<T> mlp_;
};

}  // namespace uniphy::kernels
