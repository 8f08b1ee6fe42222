#pragma once

#include <cstdint>
#include <vector>

#include "ops/kernels/learned/learned_law_table.hpp"

namespace uniphy::ops {

/// Running sums of the gradients of all weights and biases, but for the part of the first weight
/// that takes z: how they lie in memory.
template <class T>
class WeightSums {
 public:
  explicit WeightSums(const kernels::PackedMlp<T>& net) : net_(net) {
    for (int k = 0; k < net.depth; ++k) size_ += weights_of(k) + biases_of(k);
  }
  std::int64_t size() const { return size_; }
  std::vector<kernels::WeightGradient<T>> in(T* at) const {
    std::vector<kernels::WeightGradient<T>> layers;
    for (int k = 0; k < net_.depth; ++k) {
      layers.push_back({at, at + weights_of(k)});
      at += weights_of(k) + biases_of(k);
    }
    return layers;
  }
  /// Adds a sum to the flat weights; those of the first layer have `latent` columns more.
  void add(const std::vector<kernels::WeightGradient<T>>& sum, std::int64_t latent, T* to) const {
    for (int k = 0; k < net_.depth; ++k, latent = 0) {
      const std::int64_t n_in = net_.layer[k].in, n_out = net_.layer[k].out;
      for (std::int64_t o = 0; o < n_out; ++o, to += n_in + latent)
        for (std::int64_t i = 0; i < n_in; ++i)
          to[i] += sum[k].weight[o * kernels::weight_stride(net_.layer[k].in) + i];
      for (std::int64_t o = 0; o < n_out; ++o) *to++ += sum[k].bias[o];
    }
  }

 private:
  std::int64_t weights_of(int k) const {
    return kernels::padded(net_.layer[k].out) * kernels::weight_stride(net_.layer[k].in);
  }
  std::int64_t biases_of(int k) const { return kernels::weight_stride(net_.layer[k].out); }

  const kernels::PackedMlp<T>& net_;
  std::int64_t size_ = 0;
};

}  // namespace uniphy::ops
