#include "uniphy/evaluation/ablation_stage.hpp"

#include <ATen/Parallel.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/statistics.hpp"
#include "uniphy/data/generate.hpp"
#include "uniphy/evaluation/ablation_report.hpp"
#include "uniphy/evaluation/law_cost.hpp"
#include "uniphy/evaluation/rollout_error.hpp"
#include "uniphy/evaluation/step_budget.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/training/heldout_fit.hpp"
#include "uniphy/training/trained_model_file.hpp"
#include "uniphy/training/training_report.hpp"

namespace uniphy {
namespace {

struct HeldoutSet {
  Dataset data;
  std::vector<TrajectorySetup> setups;
};

Dataset training_set(const AblationOptions& o, const AblationVariant& v, const RunDirectory& out) {
  const auto& [solids, fluids, plastics] = v.random_laws;
  const std::string random = solids + fluids + plastics == 0
                                 ? ""
                                 : fmt::format("_random_{}_{}_{}", solids, fluids, plastics);
  return drawn_dataset(o.training_set(v),
                       out.file("data") / fmt::format("train_{}{}.h5", v.trajectories, random));
}

HeldoutSet heldout_set(const AblationOptions& o, const RunDirectory& out) {
  GenerateOptions draw = o.draw;
  draw.split = Split::heldout_all;
  draw.trajectories = o.heldout_trajectories;
  HeldoutSet set;
  set.data = drawn_dataset(draw, out.file("data") / "heldout_all.h5");
  set.setups = setups_of(set.data);
  return set;
}

/// steps_within, measured once and kept: an interrupted training must resume with the number that
/// it began with.
std::int64_t steps_for(double seconds, const Dataset& data, const TrainingOptions& training,
                       const RunDirectory& out) {
  const std::filesystem::path file = out.file("steps.txt");
  if (std::filesystem::exists(file)) {
    const auto steps = parse_integer(read_text_file(file));
    if (!steps || *steps < 1) throw Error(file.string() + ": expected a number of steps");
    return *steps;
  }
  const auto taken = [&](std::int64_t steps) {
    TrainingOptions trial = training;
    trial.steps = steps;
    trial.checkpoint_every = 2 * steps;
    const std::filesystem::path scratch = out.file("trial.pt");
    std::filesystem::remove(scratch);  // of a trial that was interrupted
    return train(data, trial, scratch).seconds;
  };
  const std::int64_t steps = steps_within(seconds, taken);
  write_text_file(file, std::to_string(steps));
  return steps;
}

void set_overall(Metrics& metrics, const std::string& name, const std::vector<double>& values,
                 const Dataset& data) {
  metrics.set(name, kernels::median(values));
  report_errors(data, values, name, metrics);
}

/// Medians over trajectories that project are not those over the others, whose errors are absolute.
void set_law_errors(Metrics& metrics, const std::vector<LawError>& errors, const Dataset& data) {
  std::vector<double> stress, projection;
  for (const LawError& e : errors) {
    stress.push_back(e.stress);
    if (e.projects) projection.push_back(e.projection);
  }
  report_law_errors(data, errors, "", metrics);
  metrics.set("stress_error", kernels::median(stress));
  metrics.set("projection_error", projection.empty() ? 0.0 : kernels::median(projection));
}

Metrics make(const AblationVariant& variant, const AblationOptions& o, const HeldoutSet& heldout,
             const RunDirectory& all, const RunDirectory& out) {
  const Dataset data = training_set(o, variant, all);
  TrainingOptions training = variant.training;
  if (o.budget_seconds) training.steps = steps_for(*o.budget_seconds, data, training, out);
  const LawColumns heldout_columns = law_columns(heldout.data, training.law.form);
  const TrainingResult result = train(data, training, out.file("checkpoint.pt"), &heldout_columns);
  const models::TrainedModel& model = result.model;
  write_model(out.file("model.h5"), model_file(model, out.config_yaml(), time_steps(data)), true);
  write_training_curves(out, result.history);
  Metrics metrics;
  metrics.set("parameters", double(model.law->parameter_count()));
  metrics.set("steps", double(training.steps));
  metrics.set("train_s", result.seconds);

  const auto weights = std::make_shared<const kernels::LearnedLawWeights>(model.law->weights());
  LatentFitOptions fit_options = o.fit;
  fit_options.loss = training.loss;
  const HeldoutFit fit = fit_heldout(heldout.data, heldout_columns, model, weights, fit_options);
  const auto laws = learned_laws(weights, fit.latents);
  metrics.set("law_ns", law_cost(laws.front(), heldout.data));
  const std::vector<RolloutError> rollouts = rollout_errors(heldout.setups, laws);
  std::vector<double> rollout;
  double failed = 0;
  for (std::size_t i = 0; i < rollouts.size(); ++i) {
    rollout.push_back(rollouts[i].root_over_size);
    if (!rollouts[i].failure.empty()) ++failed;
  }
  set_law_errors(metrics, fit.errors, heldout.data);
  set_overall(metrics, "rollout_error", rollout, heldout.data);
  metrics.set("rollouts_failed", failed);
  return metrics;
}

/// The metrics of a variant: of its folder where it is finished, made anew otherwise.
Metrics metrics_of(const AblationVariant& variant, const AblationOptions& o,
                   const HeldoutSet& heldout, const RunDirectory& all) {
  const std::filesystem::path folder = all.file(variant.name);
  make_directory(folder);
  const std::string settings = o.settings_of(variant);
  const std::filesystem::path record = folder / "settings.txt", done = folder / "metrics.json";
  if (!std::filesystem::exists(record)) {
    write_text_file(record, settings);
  } else if (read_text_file(record) != settings) {
    throw Error(folder.string() +
                ": was made with other settings (settings.txt); remove it or choose another --out");
  }
  if (std::filesystem::exists(done)) return Metrics::read(done);
  const RunDirectory out(folder, all.config_yaml(), all.threads());
  const Metrics metrics = make(variant, o, heldout, all, out);
  metrics.write(done);  // last: a variant is finished or not
  return Metrics::read(done);
}

void run(const AblationOptions& o, RunDirectory& out, Metrics& metrics) {
  at::set_num_threads(out.threads());
  make_directory(out.file("data"));
  const HeldoutSet heldout = heldout_set(o, out);
  std::vector<std::string> materials;
  for (const MaterialRanges& ranges : o.draw.materials) materials.push_back(ranges.name());
  std::vector<AblationRow> rows;
  for (const AblationVariant& variant : o.variants) {
    std::fprintf(stderr, "%s (%zu of %zu)\n", variant.name.c_str(), rows.size() + 1,
                 o.variants.size());
    rows.push_back({variant, metrics_of(variant, o, heldout, out)});
    for (const auto& [name, value] : rows.back().metrics.entries()) {
      metrics.set(variant.name + "." + name, value);
    }
    // After each, so that there is something to look at meanwhile.
    out.write_table("ablation.md", "Variants", ablation_table(rows, materials));
    write_text_file(out.file("ablation.csv"), ablation_csv(rows));
  }
  std::fputs(ablation_table(rows, materials).c_str(), stdout);
  plot_against_cost(rows, out);
}

}  // namespace

RunFunction ablation_stage(Section& config) {
  const AblationOptions o = read_ablation_options(config);
  return [o](RunDirectory& out, Metrics& metrics) { run(o, out, metrics); };
}

}  // namespace uniphy
