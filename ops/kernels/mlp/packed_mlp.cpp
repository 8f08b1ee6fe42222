#include "ops/kernels/mlp/packed_mlp.hpp"

#include <algorithm>

namespace uniphy::kernels {

namespace {

/// rows×cols matrix, element (r, c) at from[r * row_stride + c * column_stride], as
/// [padded(rows) / 4, cols, 4].
template <class T>
std::vector<T> pack(int rows, int cols, const double* from, std::ptrdiff_t row_stride,
                    std::ptrdiff_t column_stride) {
  std::vector<T> packed(std::size_t(padded(rows)) * cols, T(0));
  T* to = packed.data();
  for (int first = 0; first < rows; first += kOutputBlock) {
    const int count = std::min(kOutputBlock, rows - first);
    const double* block = from + first * row_stride;
    for (int c = 0; c < cols; ++c, to += kOutputBlock)
      for (int r = 0; r < count; ++r) to[r] = T(block[r * row_stride + c * column_stride]);
  }
  return packed;
}

}  // namespace

template <class T>
PackedMlpStorage<T>::PackedMlpStorage(const MlpWeights& weights, Activation activation,
                                      const std::vector<double>& z)
    : latent_size_(z.size()) {
  mlp_.depth = int(weights.layers.size());
  mlp_.activation = activation;
  for (std::size_t k = 0; k < weights.layers.size(); ++k) {
    const MlpWeights::Layer& layer = weights.layers[k];
    const int folded = k == 0 ? int(latent_size_) : 0;
    const int in = layer.in - folded, out = layer.out;
    const auto element = [&](int r, int c) { return layer.weight[std::size_t(r) * layer.in + c]; };
    std::vector<T> bias(padded(out), T(0));
    for (int r = 0; r < out; ++r) {
      double b = layer.bias[r];
      for (int c = 0; c < folded; ++c) b += element(r, in + c) * z[c];
      bias[r] = T(b);
    }
    if (k == 0)
      for (int r = 0; r < out; ++r)
        for (int c = 0; c < folded; ++c) latent_weight_.push_back(element(r, in + c));
    numbers_.push_back(pack<T>(out, in, layer.weight.data(), layer.in, 1));
    numbers_.push_back(pack<T>(in, out, layer.weight.data(), 1, layer.in));
    numbers_.push_back(std::move(bias));
    const std::size_t at = numbers_.size() - 3;
    layers_.push_back(
        {in, out, numbers_[at].data(), numbers_[at + 1].data(), numbers_[at + 2].data()});
    mlp_.max_width = std::max({mlp_.max_width, padded(in), padded(out)});
  }
  mlp_.layer = layers_.data();
}

template <class T>
void PackedMlpStorage<T>::add_latent_gradient(const T* bias_gradient,
                                              std::vector<double>& z_gradient) const {
  const int out = layers_.front().out;
  for (int r = 0; r < out; ++r)
    for (std::size_t c = 0; c < latent_size_; ++c)
      z_gradient[c] += latent_weight_[r * latent_size_ + c] * double(bias_gradient[r]);
}

template class PackedMlpStorage<float>;
template class PackedMlpStorage<double>;

}  // namespace uniphy::kernels
