#include "uniphy/evaluation/heldout_stage.hpp"

#include <ATen/Parallel.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "ops/kernels/base/error.hpp"
#include "uniphy/data/generate.hpp"
#include "uniphy/evaluation/error_table.hpp"
#include "uniphy/evaluation/heldout_options.hpp"
#include "uniphy/evaluation/heldout_report.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/training/heldout_fit.hpp"
#include "uniphy/training/trained_model_file.hpp"

namespace uniphy {
namespace {

using Weights = std::shared_ptr<const kernels::LearnedLawWeights>;

HeldoutOptions read(Section& config) {
  HeldoutOptions o;
  o.draw.seed = static_cast<std::uint64_t>(
      config.integer("seed", 1, between(0, 9e15), "",
                     "materials, shapes and motions of both sets follow from it"));
  o.model = config.input_file("model", "models/pretrained/unified.h5", "the trained law");
  o.draw.trajectories = 8;
  read_draw_options(config, o.draw);
  o.fit = read_latent_fit_options(config, true);
  Section rest = config.section("rest", "a sphere that is left alone, without gravity");
  o.rest.steps = rest.integer("steps", o.rest.steps, at_least(1), "", "of every code");
  o.rest.particles = rest.integer("particles", o.rest.particles, between(8, 100000), "", "about");
  o.rest.grid = o.draw.grid;
  o.rest.density = o.draw.density;
  o.rest.dt = o.draw.dt.value_or(o.rest.dt);
  return o;
}

/// Adds the seconds since its last call to a metric.
class Stopwatch {
 public:
  explicit Stopwatch(Metrics& metrics) : metrics_(metrics) {}
  void add_to(const std::string& name) {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    metrics_.set(name, metrics_.find(name).value_or(0) + seconds);
    last_ = now;
  }

 private:
  Metrics& metrics_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

EvaluatedSet evaluate(Split split, const HeldoutOptions& o, const models::TrainedModel& model,
                      const Weights& weights, const RunDirectory& out, Stopwatch& watch) {
  EvaluatedSet set;
  set.name = split_name(split);
  GenerateOptions draw = o.draw;
  draw.split = split;
  set.data = drawn_dataset(draw, out.file(set.name + ".h5"));
  set.setups = setups_of(set.data);
  watch.add_to("draw_s");
  const HeldoutFit fit =
      fit_heldout(set.data, law_columns(set.data, model.law->form()), model, weights, o.fit);
  set.law = fit.errors;
  set.laws = learned_laws(weights, fit.latents);
  watch.add_to("fit_s");
  set.rollouts = rollout_errors(set.setups, set.laws);
  for (std::size_t i = 0; i < set.rollouts.size(); ++i) {
    if (set.rollouts[i].failure.empty()) continue;
    std::fprintf(stderr, "roll-out failed: %s %zu (%s): %s\n", set.name.c_str(), i,
                 set.data.trajectories[i].material.c_str(), set.rollouts[i].failure.c_str());
  }
  watch.add_to("rollout_s");
  return set;
}

void check_laws(const std::vector<EvaluatedSet>& sets, const ModelFile& model,
                const Weights& weights, const HeldoutOptions& o, Metrics& metrics) {
  FrameIndifference worst;
  std::vector<kernels::LawDescription> all = learned_laws(weights, model.latents);
  for (const EvaluatedSet& set : sets) {
    worst.include(frame_indifference(set.data, set.laws, o.draw.seed));
    all.insert(all.end(), set.laws.begin(), set.laws.end());
  }
  const bool finite = std::isfinite(worst.stress) && std::isfinite(worst.projection);
  metrics.set("frame_indifference",
              finite ? std::max(worst.stress, worst.projection) : std::nan(""));
  metrics.set("frame_indifference.stress", worst.stress);
  metrics.set("frame_indifference.projection", worst.projection);
  const std::vector<double> drifts = rest_drifts(all, o.rest);
  metrics.set("rest_drift", *std::max_element(drifts.begin(), drifts.end()));
  metrics.set("codes_at_rest", static_cast<double>(drifts.size()));
}

std::string markdown(const std::vector<EvaluatedSet>& sets, const HeldoutOptions& o,
                     const Metrics& metrics) {
  std::vector<std::string> materials;
  for (const MaterialRanges& ranges : o.draw.materials) materials.push_back(ranges.name());
  std::vector<ErrorRow> rows;
  for (const char* prefix : {"", "heldout_materials."}) {
    const std::string beside = *prefix ? ", new materials" : "";
    rows.push_back({"stress" + beside, &metrics, std::string(prefix) + "stress_error"});
    rows.push_back({"projection" + beside, &metrics, std::string(prefix) + "projection_error"});
    rows.push_back({"projection, absolute, where nothing is projected" + beside, &metrics,
                    std::string(prefix) + "unprojected_error"});
    rows.push_back({"roll-out" + beside, &metrics, std::string(prefix) + "rollout_error"});
  }
  std::size_t rollouts = 0;
  for (const EvaluatedSet& set : sets) rollouts += set.rollouts.size();
  return error_table(rows, materials) +
         fmt::format(
             "\nSeed {}, {} trajectories of each material in each set; medians, worst in "
             "brackets. Roll-outs of {} steps, root of position_mse over object size; {:g} "
             "of {} did not finish. Frame indifference {:.1e} (stress), {:.1e} "
             "(projection); drift at rest {:.1e} m over {:g} codes and {} steps.\n",
             o.draw.seed, o.draw.trajectories, o.draw.steps, *metrics.find("rollouts_failed"),
             rollouts, *metrics.find("frame_indifference.stress"),
             *metrics.find("frame_indifference.projection"), *metrics.find("rest_drift"),
             *metrics.find("codes_at_rest"), o.rest.steps);
}

void run(const HeldoutOptions& o, RunDirectory& out, Metrics& metrics) {
  at::set_num_threads(out.threads());
  const ModelFile model = read_model(o.model);
  if (model.codes() == 0) {
    throw Error(o.model.string() + ": expected latent codes to start the fits from, found none");
  }
  const auto weights = std::make_shared<const kernels::LearnedLawWeights>(model.weights);
  const models::TrainedModel trained = trained_model(model);
  Stopwatch watch(metrics);
  std::vector<EvaluatedSet> sets;
  double failed = 0;
  for (const Split split : {Split::heldout_all, Split::heldout_materials}) {
    sets.push_back(evaluate(split, o, trained, weights, out, watch));
    const EvaluatedSet& set = sets.back();
    const std::string prefix = split == Split::heldout_all ? "" : set.name + ".";
    report_law_errors(set.data, set.law, prefix, metrics);
    report_errors(set.data, set.rollout_values(), prefix + "rollout_error", metrics);
    failed += static_cast<double>(set.failed());
    plot_errors(set, prefix, out);
  }
  metrics.set("rollouts_failed", failed);
  metrics.set("heldout_materials.rollouts_failed", static_cast<double>(sets[1].failed()));
  watch.add_to("report_s");
  check_laws(sets, model, weights, o, metrics);
  watch.add_to("checks_s");
  write_text_file(out.file("errors.csv"), errors_csv(sets));
  const std::string table = markdown(sets, o, metrics);
  out.write_table("errors.md", "Errors", table);
  std::fputs(table.c_str(), stdout);
  plot_worst(sets, out);
}

}  // namespace

RunFunction heldout_stage(Section& config) {
  const HeldoutOptions o = read(config);
  return [o](RunDirectory& out, Metrics& metrics) { run(o, out, metrics); };
}

}  // namespace uniphy
