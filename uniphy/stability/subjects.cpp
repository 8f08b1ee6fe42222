#include "uniphy/stability/subjects.hpp"

#include <ATen/CPUGeneratorImpl.h>
#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "models/learned_law.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/hash.hpp"
#include "uniphy/data/material_ranges.hpp"
#include "uniphy/geometry/random.hpp"

namespace uniphy::stability {
namespace {

constexpr std::int64_t kPublishedLatent = 32;  ///< the authors' size

/// The squared distance of a material to the middle of the ranges, in units of their widths.
double distance_to_middle(const MaterialRanges& ranges, const MaterialParameters& parameters) {
  double sum = 0;
  for (const kernels::LawParameter& p : kernels::law_parameters(ranges.id)) {
    const auto k = static_cast<std::size_t>(p.place);
    const auto [low, high] = ranges.interval[k];
    const bool logarithmic = p.member != &kernels::LawDescription::theta;
    const auto unit = [&](double value) { return logarithmic ? std::log(value) : value; };
    const double share = (unit(parameters[k]) - unit(low)) / (unit(high) - unit(low));
    sum += (share - 0.5) * (share - 0.5);
  }
  return sum;
}

kernels::LawDescription analytic_law(const MaterialRanges& ranges,
                                     const MaterialParameters& parameters) {
  kernels::LawDescription law;
  law.id = ranges.id;
  for (const kernels::LawParameter& p : kernels::law_parameters(ranges.id))
    law.*p.member = parameters[static_cast<std::size_t>(p.place)];
  return law;
}

std::string fingerprint_of(const ModelFile& model) {
  kernels::Hash hash;
  for (const auto* network : {&model.weights.projection, &model.weights.stress}) {
    for (const auto& layer : network->layers) hash.add(layer.weight).add(layer.bias);
  }
  return hash.add(model.latents).text();
}

}  // namespace

const kernels::LawDescription& Subject::law(const std::string& method) const {
  if (method == "isotropic" || method == "exported") return isotropic;
  return method == "published" ? published : analytic;
}

Subjects load_subjects(const StabilityOptions& options) {
  Subjects all;
  all.model = read_model(options.model);
  all.fingerprint = fingerprint_of(all.model);
  if (all.model.weights.form != kernels::LawForm::isotropic) {
    throw Error(fmt::format("{}: form: expected isotropic, found {}", options.model.string(),
                            kernels::form_name(all.model.weights.form)));
  }
  const auto shared = std::make_shared<const kernels::LearnedLawWeights>(all.model.weights);

  models::LearnedLawOptions size;
  size.form = kernels::LawForm::published;
  size.activation = kernels::Activation::gelu;
  size.latent_size = kPublishedLatent;
  size.hidden_layers = 4;
  size.width = 128;
  torch::Generator generator = torch::make_generator<at::CPUGeneratorImpl>(options.seed);
  const auto random = std::make_shared<const kernels::LearnedLawWeights>(
      models::LearnedLaw(size, generator)->weights());

  UniformRandom draw(options.seed);
  for (const MaterialRanges& ranges : default_material_ranges()) {
    std::int64_t nearest = -1;
    double least = std::numeric_limits<double>::infinity();
    for (std::int64_t i = 0; i < all.model.codes(); ++i) {
      if (all.model.materials[static_cast<std::size_t>(i)] != ranges.name()) continue;
      const double d =
          distance_to_middle(ranges, all.model.parameters[static_cast<std::size_t>(i)]);
      if (d < least) {
        least = d;
        nearest = i;
      }
    }
    if (nearest < 0) {
      throw Error(fmt::format("{}: expected a code of {}, found none", options.model.string(),
                              ranges.name()));
    }
    Subject subject;
    subject.material = ranges.name();
    subject.analytic =
        analytic_law(ranges, all.model.parameters[static_cast<std::size_t>(nearest)]);
    subject.isotropic.id = kernels::LawId::learned;
    subject.isotropic.weights = shared;
    subject.isotropic.z = all.model.code(nearest);
    subject.published.id = kernels::LawId::learned;
    subject.published.weights = random;
    for (std::int64_t k = 0; k < kPublishedLatent; ++k)
      subject.published.z.push_back(draw.between(-0.5, 0.5));
    // The scales of stress and strain, which both forms carry in the same two coordinates.
    for (std::size_t k = 0; k < 2 && k < subject.isotropic.z.size(); ++k)
      subject.published.z[k] = subject.isotropic.z[k];
    all.materials.push_back(subject);
  }
  return all;
}

}  // namespace uniphy::stability
