#include "uniphy/bench/random_law.hpp"

#include <cmath>
#include <random>

namespace uniphy::bench {

using kernels::LawForm;

std::shared_ptr<const kernels::LearnedLawWeights> random_law(LawForm form) {
  const bool isotropic = form == LawForm::isotropic;
  const int width = isotropic ? 32 : 128, hidden = isotropic ? 3 : 4;
  auto law = std::make_shared<kernels::LearnedLawWeights>();
  law->form = form;
  law->latent_size = isotropic ? 8 : 32;
  law->activation = isotropic ? kernels::Activation::silu : kernels::Activation::gelu;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  // The last layers are small, so that their biases decide: no gate near, a soft elastic stress.
  const auto network = [&](int in, int out, const std::vector<double>& last_bias) {
    kernels::MlpWeights mlp;
    for (int k = 0; k <= hidden; ++k) {
      kernels::MlpWeights::Layer layer;
      layer.in = k == 0 ? in + law->latent_size : width;
      layer.out = k == hidden ? out : width;
      const double gain = (k == hidden ? 1e-4 : 1.4) / std::sqrt(double(layer.in));
      for (int i = 0; i < layer.in * layer.out; ++i) layer.weight.push_back(gain * normal(random));
      layer.bias.assign(layer.out, 0.0);
      if (k < hidden) {
        for (double& b : layer.bias) b = 0.1 * normal(random);
      } else {
        for (std::size_t i = 0; i < layer.bias.size() && i < last_bias.size(); ++i)
          layer.bias[i] = last_bias[i];
      }
      mlp.layers.push_back(layer);
    }
    return mlp;
  };
  const kernels::NetworkShape shape = kernels::network_shape(form);
  const std::vector<double> caps{3, 3}, coefficients{1, 0, 1}, none;
  law->projection = network(shape.projection_in, shape.projection_out, isotropic ? caps : none);
  law->stress = network(shape.stress_in, shape.stress_out, isotropic ? coefficients : none);
  return law;
}

std::vector<double> random_code(const kernels::LearnedLawWeights& weights) {
  std::mt19937 random(8);
  std::normal_distribution<double> normal(0, 0.1);
  std::vector<double> z(weights.latent_size);
  for (double& number : z) number = normal(random);
  return z;
}

double multiply_adds_of(const kernels::LearnedLawWeights& weights) {
  double count = 0;
  for (const auto* network : {&weights.projection, &weights.stress}) {
    for (std::size_t k = 0; k < network->layers.size(); ++k) {
      const auto& layer = network->layers[k];
      count += double(layer.in - (k == 0 ? weights.latent_size : 0)) * layer.out;
    }
  }
  return count;
}

}  // namespace uniphy::bench
