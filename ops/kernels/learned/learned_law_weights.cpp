#include "ops/kernels/learned/learned_law_weights.hpp"

#include <cmath>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {
namespace {

void check_network(const std::string& name, const MlpWeights& network, int inputs, int outputs) {
  if (network.layers.empty()) throw Error(name + ": expected at least one layer, found none");
  int in = inputs;
  for (std::size_t k = 0; k < network.layers.size(); ++k) {
    const MlpWeights::Layer& layer = network.layers[k];
    const std::string title = name + "/layer_" + std::to_string(k);
    const bool last = k + 1 == network.layers.size();
    if (layer.in != in) {
      throw Error(title + ": expected " + std::to_string(in) + " inputs" +
                  (k == 0 ? " (features and latent)" : "") + ", found " + std::to_string(layer.in));
    }
    if (last ? layer.out != outputs : layer.out < 1) {
      throw Error(title + ": expected " + (last ? std::to_string(outputs) : "at least 1") +
                  " outputs, found " + std::to_string(layer.out));
    }
    const auto weights = static_cast<std::size_t>(layer.in) * static_cast<std::size_t>(layer.out);
    if (layer.weight.size() != weights) {
      throw Error(title + "/weight: expected " + std::to_string(weights) + " numbers, found " +
                  std::to_string(layer.weight.size()));
    }
    if (layer.bias.size() != static_cast<std::size_t>(layer.out)) {
      throw Error(title + "/bias: expected " + std::to_string(layer.out) + " numbers, found " +
                  std::to_string(layer.bias.size()));
    }
    for (const std::vector<double>* numbers : {&layer.weight, &layer.bias}) {
      for (const double number : *numbers) {
        if (!std::isfinite(number)) {
          throw Error(title + (numbers == &layer.weight ? "/weight" : "/bias") +
                      ": expected finite numbers, found " + std::to_string(number));
        }
      }
    }
    in = layer.out;
  }
}

}  // namespace

const char* activation_name(Activation activation) {
  switch (activation) {
    case Activation::gelu:
      return "gelu";
    case Activation::silu:
      return "silu";
    case Activation::squareplus:
      return "squareplus";
  }
  return "unknown";
}

Activation activation_from_name(const std::string& name) {
  for (const Activation activation : {Activation::gelu, Activation::silu, Activation::squareplus}) {
    if (name == activation_name(activation)) return activation;
  }
  throw Error("expected an activation from gelu, silu, squareplus, found \"" + name + "\"");
}

const char* form_name(LawForm form) {
  return form == LawForm::isotropic ? "isotropic" : "published";
}

LawForm form_from_name(const std::string& name) {
  for (const LawForm form : {LawForm::isotropic, LawForm::published}) {
    if (name == form_name(form)) return form;
  }
  throw Error("expected a form of the law from isotropic, published, found \"" + name + "\"");
}

void LearnedLawWeights::check() const {
  if (latent_size < 0) {
    throw Error("latent_size: expected at least 0, found " + std::to_string(latent_size));
  }
  const NetworkShape shape = network_shape(form);
  check_network("projection", projection, shape.projection_in + latent_size, shape.projection_out);
  check_network("stress", stress, shape.stress_in + latent_size, shape.stress_out);
}

namespace {

/// One linear layer that answers with `bias` whatever its input.
MlpWeights constant_network(int in, const std::vector<double>& bias) {
  MlpWeights::Layer layer;
  layer.in = in;
  layer.out = int(bias.size());
  layer.weight.assign(std::size_t(layer.in) * layer.out, 0.0);
  layer.bias = bias;
  return {{layer}};
}

}  // namespace

bool ignores_state(const MlpWeights& network, int features) {
  const MlpWeights::Layer& first = network.layers.front();
  for (int o = 0; o < first.out; ++o)
    for (int i = 0; i < features; ++i)
      if (first.weight[std::size_t(o) * first.in + i] != 0) return false;
  return true;
}

std::shared_ptr<const LearnedLawWeights> without_projection(const LearnedLawWeights& weights) {
  const auto shape = network_shape(weights.form);
  auto r = std::make_shared<LearnedLawWeights>();
  r->form = weights.form;
  r->latent_size = weights.latent_size;
  r->activation = weights.activation;
  r->stress = weights.stress;
  r->projection = constant_network(shape.projection_in + weights.latent_size,
                                   weights.form == LawForm::isotropic
                                       ? std::vector<double>{1e30, 1e30, 0.0, 0.0, 0.0}
                                       : std::vector<double>(shape.projection_out, 0.0));
  return r;
}

std::shared_ptr<const LearnedLawWeights> without_stress(const LearnedLawWeights& weights) {
  const auto shape = network_shape(weights.form);
  auto r = std::make_shared<LearnedLawWeights>();
  r->form = weights.form;
  r->latent_size = weights.latent_size;
  r->activation = weights.activation;
  r->projection = weights.projection;
  r->stress = constant_network(shape.stress_in + weights.latent_size,
                               std::vector<double>(shape.stress_out, 0.0));
  return r;
}

}  // namespace uniphy::kernels
