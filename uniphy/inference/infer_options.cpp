#include "uniphy/inference/infer_options.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "ops/kernels/base/error.hpp"
#include "uniphy/scene/law_config.hpp"

namespace uniphy {
namespace {

constexpr const char* kRangeText =
    "starts are drawn from here; no bound: a fit may end outside, which is marked. A range of one "
    "value is a constant";

}  // namespace

FitOptions read_fit_options(Section& config) {
  FitOptions options;
  options.dtype = config.choice("dtype", std::string("float32"), {"float32", "float64"},
                                "precision of the roll-outs that gradients go through");

  options.rollout = config.choice(
      "rollout", std::string("fused"), {"fused", "stepwise"},
      "fused: one op with an adjoint of its own; stepwise: Algorithm 2 line by line, the same "
      "numbers for several times the time and memory");

  Section prior = config.section("prior", "adds weight |z|^2/sigma^2 to mse/size^2");
  options.prior = prior.real("weight", 0, between(0, 1e6), "", "0: no prior");
  options.prior_sigma = prior.real("sigma", 1, between(1e-6, 1e6), "", "width of the prior");

  Section schedule = config.section(
      "schedule", "stages; each list has one entry a stage, the last one sees all frames");
  const Range sizes = between(1, 20);
  const auto horizon =
      schedule.reals("horizon", std::vector<double>{0.25, 0.5, 1}, Range{0, 1, true}, "",
                     "share of the time from first contact to the end that is compared", sizes);
  const auto candidates =
      schedule.integers("candidates", std::vector<std::int64_t>{10, 6, 2}, between(1, 10000), "",
                        "points that are improved; the best go on to the next stage", sizes);
  const auto epochs =
      schedule.integers("epochs", std::vector<std::int64_t>{8, 12, 40}, between(1, 100000), "",
                        "roll-outs with gradients of each candidate (levenberg_marquardt: "
                        "Jacobians, of which three to ten do)",
                        sizes);
  const std::string method =
      schedule.choice("optimizer", std::string("lbfgs"), {"lbfgs", "adamw", kLevenbergMarquardt},
                      "how candidates are improved: by gradients, torch::optim::LBFGS (strong "
                      "Wolfe) or AdamW, or by least squares with a Jacobian from differences");
  const double rate = schedule.real(
      "rate", 0.1, Range{0, 1e3, true}, "",
      "lbfgs: length of the first step (adamw: of every step, falling along a cosine), in "
      "units of the spread of the training codes");
  options.patience = static_cast<int>(schedule.integer(
      "patience", 8, at_least(1), "",
      "lbfgs, adamw: a candidate stops after so many epochs that gain less than 1 %"));
  options.clip = schedule.real("clip", 10, Range{0, 1e6, true}, "",
                               "adamw: longest gradient, in multiples of their mean length");
  if (!config.describing()) {
    if (method == kLevenbergMarquardt && options.dtype == "float32") {
      config.fail("dtype", fmt::format("expected float64 with schedule.optimizer {}, whose "
                                       "differences float32 cannot tell, found float32",
                                       method));
    }
    if (candidates.size() != horizon.size() || epochs.size() != horizon.size()) {
      schedule.fail("horizon",
                    fmt::format("expected lists of one length in horizon, candidates and epochs, "
                                "found {}, {} and {} entries",
                                horizon.size(), candidates.size(), epochs.size()));
    }
    if (!std::is_sorted(candidates.rbegin(), candidates.rend())) {
      schedule.fail("candidates", "expected numbers that do not grow: the best of a stage go on");
    }
    if (horizon.back() != 1) {
      schedule.fail("horizon",
                    fmt::format("expected 1 in the last stage, found {}", horizon.back()));
    }
  }
  for (std::size_t i = 0; i < horizon.size() && i < candidates.size() && i < epochs.size(); ++i) {
    options.stages.push_back(
        {horizon[i], static_cast<int>(candidates[i]), static_cast<int>(epochs[i]), method, rate});
  }
  return options;
}

ObservationSource read_observation_source(Section& config) {
  ObservationSource source;
  source.file = config.input_file("observation", required, "observed positions (observation.h5)");
  source.noise = config.real("noise", 0, between(0, 1), "m",
                             "standard deviation of a coordinate; 0: what the observation says, "
                             "else estimated from it");
  source.cloud_distance = config.choice(
      "cloud_distance", std::string("transport"), {"transport", "chamfer", "nearest"},
      "of clouds without correspondence: debiased entropic optimal transport, for clouds that show "
      "the whole body; two-sided Chamfer; or the distance of the points of a cloud from the body "
      "alone, where it shows a part of it, as its surface");
  source.start_degree = static_cast<int>(config.integer(
      "start_degree", -1, between(-1, kMostStartDegree), "",
      "0: at the first frame the body is undeformed and moves as a rigid one; 1 to 3: it is "
      "deformed, and its velocity and stretch there are fitted as polynomials in the place (2 does "
      "for most; a Jacobian takes 36, 90 or 180 roll-outs more); -1: what the observation says"));
  Section s = config.section("resolution", "how finely the observation is simulated");
  source.resolution.grid = static_cast<int>(
      s.integer("grid", 0, between(0, 1024), "",
                "nodes a side, on which the body is filled anew; 0: those of the observation"));
  source.resolution.dt = s.real("dt", 0, between(0, 1), "s",
                                "time step; 0: that of the observation, as much finer as the grid");
  source.resolution.particles_a_cell = s.real("particles_a_cell", 8, between(1, 64), "",
                                              "of a body that is filled: a surface, or on "
                                              "another grid any");
  return source;
}

std::vector<ObservedBody> ObservationSource::load(std::vector<std::string>& warnings) const {
  std::vector<ObservedBody> bodies = read_observed_bodies(file);
  for (auto& [body, seen] : bodies) {
    const std::string name = body.empty() ? file.string() : file.string() + ": " + body;
    seen = at_resolution(seen, resolution, name, warnings);
    if (noise > 0) seen.noise = noise;
    seen.cloud_distance = cloud_distance;
    if (start_degree >= 0) seen.start_degree = start_degree;
    if (seen.cloud > 0 && seen.start_degree > 0) {
      throw Error(
          fmt::format("{}: start_degree: expected 0 for clouds without correspondence, found {}",
                      name, seen.start_degree));
    }
  }
  return bodies;
}

FitVariablesSource read_fit_variables(Section& config) {
  FitVariablesSource source;
  Section law = config.section("law", "what is fitted");
  std::vector<Variant> variants;
  variants.push_back(
      {"learned", "the latent code of a trained model; starts from its codes", [&](Section& s) {
         source.id = kernels::LawId::learned;
         source.model = s.text("model", std::string("models/pretrained/unified.h5"),
                               "trained model (model.h5)");
       }});
  for (int i = 0; i < static_cast<int>(kernels::LawId::learned); ++i) {
    const auto id = static_cast<kernels::LawId>(i);
    if (id == kernels::LawId::volume_corrected_sand) continue;  // an option of sand
    variants.push_back(
        {kernels::law_name(id), "its parameters, as logarithms", [&source, id](Section& s) {
           source.id = id == kernels::LawId::sand ? read_sand(s) : id;
           const auto defaults = default_ranges(id);
           source.ranges.clear();
           for (std::size_t k = 0; k < defaults.size(); ++k) {
             const kernels::LawParameter& p = kernels::law_parameters(id)[k];
             Range range = range_of(p);
             range.low_open = true;  // they are fitted as logarithms
             source.ranges.push_back(s.interval(p.name, defaults[k], range, p.unit, kRangeText));
           }
           const auto constant = [](const std::array<double, 2>& r) { return r[0] == r[1]; };
           if (std::all_of(source.ranges.begin(), source.ranges.end(), constant)) {
             s.fail(kernels::law_parameters(id)[0].name,
                    "expected a parameter with a range of more than one value, found constants, "
                    "which leave nothing to fit");
           }
           source.starts = static_cast<int>(
               s.integer("starts", 100, between(1, 100000), "", "points that are tried first"));
           source.seed =
               static_cast<std::uint64_t>(s.integer("seed", 1, at_least(0), "", "of the starts"));
         }});
  }
  law.variant("type", std::string("learned"), variants, "the law");
  return source;
}

std::unique_ptr<const FitVariables> FitVariablesSource::load() const {
  if (id != kernels::LawId::learned) return make_analytic_variables(id, ranges, starts, seed);
  const ModelFile file = read_model(model);
  if (file.codes() == 0) {
    throw Error(
        fmt::format("{}: /latents/z: expected codes to start from, found none", model.string()));
  }
  return make_latent_variables(file);
}

}  // namespace uniphy
