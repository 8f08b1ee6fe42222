#include "ops/learned/learned_networks.hpp"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::ops {
namespace {

FlatLayers tensors(const kernels::MlpWeights& mlp, torch::Dtype dtype) {
  std::vector<LinearLayer> layers;
  for (const kernels::MlpWeights::Layer& layer : mlp.layers) {
    layers.push_back(
        {torch::tensor(layer.weight, torch::kFloat64).view({layer.out, layer.in}).to(dtype),
         torch::tensor(layer.bias, torch::kFloat64).to(dtype)});
  }
  return flatten(layers);
}

std::vector<double> numbers(const torch::Tensor& t) {
  const torch::Tensor flat = t.detach().to(torch::kFloat64).contiguous();
  return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
}

kernels::MlpWeights weights(const FlatLayers& flat) {
  kernels::MlpWeights mlp;
  for (const LinearLayer& layer : layers_of(flat)) {
    mlp.layers.push_back({int(layer.weight.size(1)), int(layer.weight.size(0)),
                          numbers(layer.weight), numbers(layer.bias)});
  }
  return mlp;
}

void check_layers(const std::string& op, const std::string& name, const FlatLayers& layers,
                  std::int64_t in, std::int64_t out) {
  const std::vector<std::int64_t>& widths = layers.widths;
  const bool fits = widths.size() >= 2 && widths.front() == in && widths.back() == out &&
                    *std::min_element(widths.begin(), widths.end()) >= 1;
  if (!fits) {
    std::ostringstream s;
    s << op << ": networks." << name << ".widths: expected [" << in << ", ..., " << out
      << "] (features and latent first, outputs last), found " << at::IntArrayRef(widths);
    throw Error(s.str());
  }
  std::int64_t count = 0;
  for (std::size_t k = 0; k + 1 < widths.size(); ++k) count += (widths[k] + 1) * widths[k + 1];
  const std::string title = "networks." + name + ".numbers";
  check_tensor(op.c_str(), title.c_str(), layers.numbers,
               real_type(op.c_str(), title.c_str(), layers.numbers), {count});
}

/// A copy of the bytes, to see whether they are still the same.
class Snapshot {
 public:
  bool is(const FlatLayers& layers) const {
    const torch::Tensor t = layers.numbers.detach().contiguous();
    return t.scalar_type() == type_ && layers.widths == widths_ && t.nbytes() == bytes_.size() &&
           std::memcmp(t.data_ptr(), bytes_.data(), bytes_.size()) == 0;
  }
  void take(const FlatLayers& layers) {
    const torch::Tensor t = layers.numbers.detach().contiguous();
    const char* from = static_cast<const char*>(t.data_ptr());
    type_ = t.scalar_type();
    widths_ = layers.widths;
    bytes_.assign(from, from + t.nbytes());
  }

 private:
  torch::ScalarType type_ = torch::kFloat32;
  std::vector<std::int64_t> widths_;
  std::vector<char> bytes_;
};

}  // namespace

class KernelWeightsCache {
 public:
  using Shared = std::shared_ptr<const kernels::LearnedLawWeights>;

  Shared get(const LearnedNetworks& networks, LawPart part) {
    const std::lock_guard<std::mutex> guard(mutex_);
    if (!is(networks)) take(networks);
    if (part == LawPart::both) return both_;
    if (part == LawPart::projection) {
      if (!projection_) projection_ = kernels::without_stress(*both_);
      return projection_;
    }
    if (!stress_) stress_ = kernels::without_projection(*both_);
    return stress_;
  }

 private:
  bool is(const LearnedNetworks& n) const {
    return both_ && both_->form == n.form && both_->activation == n.activation &&
           both_->latent_size == n.latent_size && of_projection_.is(n.projection) &&
           of_stress_.is(n.stress);
  }
  void take(const LearnedNetworks& networks) {
    both_ = projection_ = stress_ = nullptr;
    auto weights = std::make_shared<const kernels::LearnedLawWeights>(to_weights(networks));
    weights->check();
    of_projection_.take(networks.projection);
    of_stress_.take(networks.stress);
    both_ = std::move(weights);
  }

  std::mutex mutex_;
  Snapshot of_projection_, of_stress_;
  Shared both_, projection_, stress_;
};

std::shared_ptr<KernelWeightsCache> make_kernel_weights_cache() {
  return std::make_shared<KernelWeightsCache>();
}

void check_networks(const char* op, const LearnedNetworks& networks) {
  if (!networks.defined())
    throw Error(std::string(op) + ": networks: expected a trained model, found none");
  const kernels::NetworkShape shape = kernels::network_shape(networks.form);
  const std::int64_t Z = networks.latent_size;
  check_layers(op, "projection", networks.projection, shape.projection_in + Z,
               shape.projection_out);
  check_layers(op, "stress", networks.stress, shape.stress_in + Z, shape.stress_out);
  const auto type = networks.projection.numbers.scalar_type();
  check_tensor(op, "networks.stress.numbers", networks.stress.numbers, type,
               {networks.stress.numbers.size(0)});
}

std::shared_ptr<const kernels::LearnedLawWeights> kernel_weights(const LearnedNetworks& networks,
                                                                 LawPart part) {
  return networks.cache->get(networks, part);
}

LearnedNetworks to_networks(const kernels::LearnedLawWeights& weights, torch::Dtype dtype) {
  weights.check();
  return {weights.form, weights.activation, weights.latent_size, tensors(weights.projection, dtype),
          tensors(weights.stress, dtype)};
}

kernels::LearnedLawWeights to_weights(const LearnedNetworks& networks) {
  kernels::LearnedLawWeights w;
  w.form = networks.form;
  w.latent_size = int(networks.latent_size);
  w.activation = networks.activation;
  w.projection = weights(networks.projection);
  w.stress = weights(networks.stress);
  return w;
}

}  // namespace uniphy::ops
