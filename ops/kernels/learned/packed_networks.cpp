#include "ops/kernels/learned/packed_networks.hpp"

namespace uniphy::kernels {
namespace {

const LearnedLawWeights& checked(const LearnedLawWeights& weights) {
  weights.check();
  return weights;
}

}  // namespace

template <class T>
PackedNetworks<T>::PackedNetworks(const LearnedLawWeights& w)
    : projection(checked(w).projection, w.activation, w.latent_size),
      stress(w.stress, w.activation, w.latent_size),
      projection_ignores_state(ignores_state(w.projection, network_shape(w.form).projection_in)),
      stress_ignores_state(ignores_state(w.stress, network_shape(w.form).stress_in)) {}

template struct PackedNetworks<float>;
template struct PackedNetworks<double>;

PackedNetworksCache& PackedNetworksCache::operator=(const PackedNetworksCache&) {
  const std::lock_guard<std::mutex> guard(mutex_);
  narrow_.reset();
  wide_.reset();
  return *this;
}

template <>
std::shared_ptr<const PackedNetworks<float>> LearnedLawWeights::packed() const {
  const std::lock_guard<std::mutex> guard(packed_networks.mutex_);
  auto& form = packed_networks.narrow_;
  if (!form) form = std::make_shared<PackedNetworks<float>>(*this);
  return form;
}
template <>
std::shared_ptr<const PackedNetworks<double>> LearnedLawWeights::packed() const {
  const std::lock_guard<std::mutex> guard(packed_networks.mutex_);
  auto& form = packed_networks.wide_;
  if (!form) form = std::make_shared<PackedNetworks<double>>(*this);
  return form;
}

}  // namespace uniphy::kernels
