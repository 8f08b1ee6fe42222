#include "uniphy/scene/law_config.hpp"

#include <fmt/format.h>

#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/latent_file.hpp"
#include "uniphy/io/model_file.hpp"

namespace uniphy {

using kernels::LawDescription;
using kernels::LawId;

Range range_of(const kernels::LawParameter& parameter) {
  return {0, parameter.below, parameter.positive, std::isfinite(parameter.below)};
}

namespace {

void read_learned(Section& law, LawSource* source) {
  source->model =
      law.input_file("model", std::string(),
                     "model file (model.h5); may be absent where the latent file names it");
  Section latent = law.section("latent", "the latent code");
  latent.variant("type", std::string("code"),
                 {{"code", "one of the codes that the model was trained with",
                   [&](Section& s) {
                     source->latent = LawSource::Latent::code;
                     source->index =
                         s.integer("index", 0, at_least(0), "", "number of the code, from 0");
                   }},
                  {"values", "the numbers themselves",
                   [&](Section& s) {
                     source->latent = LawSource::Latent::values;
                     source->z = s.reals("z", required, any_number(), "", "latent code");
                   }},
                  {"fitted", "the result of uniphy_infer",
                   [&](Section& s) {
                     source->latent = LawSource::Latent::file;
                     source->latent_file = s.input_path(
                         "path", required, "latent.h5, or the output folder that holds it");
                   }}},
                 "where the latent code comes from");
  if (!law.describing() && source->model.empty() && source->latent != LawSource::Latent::file) {
    law.fail("model", "expected a model file, found nothing");
  }
}

void check_length(const LawDescription& law, const std::string& where) {
  if (law.z.size() == static_cast<std::size_t>(law.weights->latent_size)) return;
  throw Error(
      fmt::format("{}: expected a latent code of {} numbers, the size that the model has, "
                  "found {}",
                  where, law.weights->latent_size, law.z.size()));
}

// The model named by a latent file was written as the run that made it saw it: a path from its
// working directory.
std::filesystem::path find_model(const std::filesystem::path& latent, const std::string& named) {
  const std::filesystem::path folder = latent.parent_path();
  for (const std::filesystem::path& candidate :
       {std::filesystem::path(named), folder / named, folder / "model.h5"}) {
    if (!candidate.empty() && std::filesystem::is_regular_file(candidate)) return candidate;
  }
  throw Error(
      fmt::format("{}: its model \"{}\" was not found here, nor in {}: expected the key "
                  "model to name it",
                  latent.string(), named, folder.empty() ? "." : folder.string()));
}

}  // namespace

// Sand of a scene closes up again after a separation; that of the training family does not.
LawId read_sand(Section& law) {
  const bool corrected = law.boolean(
      "volume_correction", true,
      "volume gained in a separation is given back before grains press on each other again; false: "
      "the law of the training family, which keeps it");
  return corrected ? LawId::volume_corrected_sand : LawId::sand;
}

LawSource read_law(Section& law) {
  LawSource source;
  std::vector<Variant> variants;
  const char* docs[] = {"neo-Hookean solid",
                        "weakly compressible viscous fluid; its bulk stiffness is lambda + 2/3 mu, "
                        "as published, Pa added to Pa s: the numbers hold for seconds alone",
                        "elastoplastic, von Mises yield",
                        "elastoplastic, Drucker-Prager yield",
                        "viscoplastic, von Mises yield",
                        "fixed-corotated elastic solid",
                        "inviscid weakly compressible fluid",
                        "",  // sand with an option
                        "Mooney-Rivlin solid, rubber at moderate strain",
                        "fluid that thins or thickens with the rate of shear (Carreau)",
                        "elastoplastic, Drucker-Prager yield, bears some tension",
                        "viscoplastic, von Mises yield, power of the excess (Herschel-Bulkley)",
                        "a trained model with a latent code"};
  for (int i = 0; i <= static_cast<int>(LawId::learned); ++i) {
    const LawId id = static_cast<LawId>(i);
    if (id == LawId::volume_corrected_sand) continue;
    variants.push_back({kernels::law_name(id), docs[i], [&source, id](Section& s) {
                          source.description.id = id;
                          for (const kernels::LawParameter& p : kernels::law_parameters(id)) {
                            source.description.*p.member =
                                s.real(p.name, required, range_of(p), p.unit, p.text);
                          }
                          if (id == LawId::learned) read_learned(s, &source);
                          if (id == LawId::sand) source.description.id = read_sand(s);
                        }});
  }
  law.variant("type", required, variants, "the constitutive law");
  return source;
}

LawDescription LawSource::load(LawOrigin* origin) const {
  if (description.id != LawId::learned) return description;
  if (latent == Latent::file) return load_fitted_law(latent_file, model, origin);
  const ModelFile file = read_model(model);
  if (origin != nullptr) *origin = {LawOrigin::Kind::trained, file.training_dt};
  LawDescription law = description;
  law.weights = std::make_shared<kernels::LearnedLawWeights>(file.weights);
  if (latent == Latent::code) {
    if (index >= file.codes()) {
      throw Error(
          fmt::format("{}: latent.index: expected 0 to {}, the codes of the model, found {}",
                      model.string(), file.codes() - 1, index));
    }
    law.z = file.code(index);
  } else {
    law.z = z;
  }
  check_length(law, model.string());
  return law;
}

LawDescription load_fitted_law(const std::filesystem::path& latent,
                               const std::filesystem::path& model, LawOrigin* origin) {
  const std::filesystem::path file =
      std::filesystem::is_directory(latent) ? latent / "latent.h5" : latent;
  const LatentFile fitted = read_latent(file);
  if (origin != nullptr) {
    *origin = {LawOrigin::Kind::fitted, {fitted.dt, fitted.dt}, fitted.determined};
  }
  if (fitted.law != kernels::law_name(LawId::learned)) return fitted.analytic;
  const std::filesystem::path found = model.empty() ? find_model(file, fitted.model) : model;
  LawDescription law;
  law.id = LawId::learned;
  law.weights = std::make_shared<kernels::LearnedLawWeights>(read_model(found).weights);
  law.z = fitted.z;
  check_length(law, file.string());
  return law;
}

}  // namespace uniphy
