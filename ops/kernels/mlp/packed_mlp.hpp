#pragma once

#include <cstddef>
#include <vector>

#include "ops/kernels/laws/law.hpp"

namespace uniphy::kernels {

/// Particles that one pass of a network handles: activations of a tile stay in the cache.
inline constexpr std::ptrdiff_t kTile = kLawChunk;
/// Outputs that are computed together; packed rows are padded with zeros to a multiple of it.
inline constexpr int kOutputBlock = 4;

/// Rows of a weight's gradient are padded to whole vectors of any instruction set.
constexpr std::ptrdiff_t weight_stride(int in) { return (in + 15) / 16 * 16; }

constexpr int padded(int n) { return (n + kOutputBlock - 1) / kOutputBlock * kOutputBlock; }

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
};

/// Owns the packed numbers of a network whose first layer has had the latent folded into its bias.
template <class T>
class PackedMlpStorage {
 public:
  /// Folds z: the first layer's inputs are [features, z] and its bias becomes b + W_z z.
  PackedMlpStorage(const MlpWeights& weights, Activation activation, const std::vector<double>& z);
  PackedMlpStorage(const PackedMlpStorage&) = delete;
  PackedMlpStorage& operator=(const PackedMlpStorage&) = delete;

  const PackedMlp<T>& mlp() const { return mlp_; }
  /// Adds W_zᵀ g to z_gradient, g being the gradient of the folded bias [out of layer 0].
  void add_latent_gradient(const T* bias_gradient, std::vector<double>& z_gradient) const;

 private:
  std::vector<std::vector<T>> numbers_;
  std::vector<PackedLayer<T>> layers_;
  std::vector<double> latent_weight_;  // [out of layer 0, latent]
  std::size_t latent_size_ = 0;
  PackedMlp<T> mlp_{};
};

}  // namespace uniphy::kernels
