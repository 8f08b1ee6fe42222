#include "ops/kernels/mlp/packed_mlp.hpp"

#include <algorithm>
#include <utility>

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
                                      int latent_size)
    : latent_size_(latent_size) {
  mlp_.depth = int(weights.layers.size());
  mlp_.activation = activation;
  for (std::size_t k = 0; k < weights.layers.size(); ++k) {
    const MlpWeights::Layer& layer = weights.layers[k];
    const int in = layer.in - (k == 0 ? latent_size_ : 0), out = layer.out;
    std::vector<T> bias(padded(out), T(0));
    for (int r = 0; r < out; ++r) bias[r] = T(layer.bias[r]);
    if (k == 0) {
      first_bias_ = layer.bias;
      for (int r = 0; r < out; ++r) {
        const double* row = layer.weight.data() + std::size_t(r) * layer.in;
        latent_weight_.insert(latent_weight_.end(), row + in, row + layer.in);
      }
    }
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
std::vector<T> PackedMlpStorage<T>::folded_bias(const std::vector<double>& z) const {
  const int out = layers_.front().out;
  std::vector<T> bias(padded(out), T(0));
  for (int r = 0; r < out; ++r) {
    double b = first_bias_[r];
    for (int c = 0; c < latent_size_; ++c) b += latent_weight_[r * latent_size_ + c] * z[c];
    bias[r] = T(b);
  }
  return bias;
}

template <class T>
void PackedMlpStorage<T>::add_latent_gradient(const T* bias_gradient,
                                              std::vector<double>& z_gradient) const {
  const int out = layers_.front().out;
  for (int r = 0; r < out; ++r)
    for (int c = 0; c < latent_size_; ++c)
      z_gradient[c] += latent_weight_[r * latent_size_ + c] * double(bias_gradient[r]);
}

template <class T>
std::ptrdiff_t PackedMlpStorage<T>::weight_size() const {
  std::ptrdiff_t size = std::ptrdiff_t(latent_size_) * layers_.front().out;
  for (const PackedLayer<T>& layer : layers_) size += std::ptrdiff_t(layer.in + 1) * layer.out;
  return size;
}

template <class T>
void PackedMlpStorage<T>::add_weight_gradient(const T* sums, T* gradient) const {
  int latent = latent_size_;
  for (const PackedLayer<T>& layer : layers_) {
    const std::ptrdiff_t stride = weight_stride(layer.in);
    for (int o = 0; o < layer.out; ++o, gradient += layer.in + latent)
      for (int i = 0; i < layer.in; ++i) gradient[i] += sums[o * stride + i];
    const T* bias = sums + padded(layer.out) * stride;
    for (int o = 0; o < layer.out; ++o) *gradient++ += bias[o];
    sums += weight_sums_of_layer(layer.in, layer.out);
    latent = 0;
  }
}

template <class T>
FoldedMlp<T>::FoldedMlp(std::shared_ptr<const PackedMlpStorage<T>> packed, std::vector<double> z)
    : packed_(std::move(packed)), z_(std::move(z)), bias_(packed_->folded_bias(z_)) {
  mlp_ = packed_->mlp();
  layers_.assign(mlp_.layer, mlp_.layer + mlp_.depth);
  layers_.front().bias = bias_.data();
  mlp_.layer = layers_.data();
}

template <class T>
void FoldedMlp<T>::add_weight_gradient(const T* sums, T* gradient) const {
  packed_->add_weight_gradient(sums, gradient);
  const int in = layers_.front().in, latent = packed_->latent_size();
  const T* bias = sums + padded(layers_.front().out) * weight_stride(in);
  for (int o = 0; o < layers_.front().out; ++o)
    for (int c = 0; c < latent; ++c) gradient[o * (in + latent) + in + c] += bias[o] * T(z_[c]);
}

template class PackedMlpStorage<float>;
template class PackedMlpStorage<double>;
template class FoldedMlp<float>;
template class FoldedMlp<double>;

}  // namespace uniphy::kernels
