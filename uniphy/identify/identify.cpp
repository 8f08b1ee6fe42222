#include "uniphy/identify/identify.hpp"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/data/random_law.hpp"
#include "uniphy/identify/identify_table.hpp"
#include "uniphy/inference/fit_findings.hpp"
#include "uniphy/inference/motion_objective.hpp"
#include "uniphy/inference/observed_motion.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/latent_file.hpp"
#include "uniphy/io/observation.hpp"
#include "uniphy/report/interrupt.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/scene/comparison.hpp"

namespace uniphy {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// What a case that failed has none of.
void forget_numbers(Identified& row) {
  row.fit_mse = row.fit_share = row.found_mse = row.found_share = kNan;
  row.other_best = row.resim_mse = row.resim_share = kNan;
}

/// From here on peak_memory_mb() counts anew, where the kernel allows it.
void reset_peak_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
  std::ofstream("/proc/self/clear_refs") << "5";
}

/// Best loss so far of the candidate that the result comes from, within each stage.
std::vector<double> best_so_far(const FitResult& fit) {
  std::vector<double> best;
  int stage = -1;
  for (const FitRecord& r : fit.history) {
    if (r.candidate != fit.start) continue;
    const bool first = r.stage != stage;
    stage = r.stage;
    best.push_back(first ? r.mse : std::min(best.back(), r.mse));
  }
  return best;
}

Trajectory predict(const HiddenCase& hidden, const kernels::LawDescription& law,
                   FrameFields fields) {
  SceneDescription scene = hidden.other.scene;
  scene.bodies.front().law = law;
  return run_scene(scene, fields);
}

/// Where the law found takes all particles, of which a part was observed.
Trajectory all_particles(const Observation& whole, const Inference& found, const std::string& name,
                         const std::string& dtype, bool with_F) {
  Trajectory t = observed_trajectory(whole);
  t.x.clear();
  const auto objective =
      make_motion_objective(whole, observed_steps(whole, name), observed_grid(whole, name), dtype);
  objective->simulate(found.fit.law, found.fit.motion,
                      [&](std::ptrdiff_t, const std::vector<double>& x) {
                        t.x.insert(t.x.end(), x.begin(), x.end());
                      });
  if (with_F) t.F = objective->deformations(found.fit.law, found.fit.motion, whole.frames);
  return t;
}

/// What was found beside what the hidden law is, both read by the same probe.
void name_material(const HiddenCase& hidden, const Observation& observation,
                   const Inference& result, Identified& row) {
  const MaterialBelief& belief = result.material;
  row.named = result.fit.determined ? belief.reading.material : "not determined";
  const double strain = result.fit.determined ? belief.reading.strain_seen : 0.1;
  const MaterialReading truth = read_material(hidden.observed.law(), observation.dt, strain,
                                              observation.time.back() - observation.time.front());
  row.named_right = row.named == truth.material;
  row.truth = reading_text(truth);
  if (!result.fit.determined) return;
  row.numbers = reading_text(belief);
  if (!belief.probability.empty()) row.probability = belief.probability.front().second;
}

CaseResult identify_one(const IdentifyOptions& options, std::int64_t material,
                        const FitVariables& variables, const RunDirectory& out) {
  const auto start = std::chrono::steady_clock::now();
  reset_peak_memory();
  CaseResult found;
  Identified& row = found.row;
  CasePictures& pictured = found.pictures;
  row.material = options.hidden.draw.materials[material].name();
  forget_numbers(row);
  const std::filesystem::path folder = out.file(row.material);
  make_directory(folder);

  // The report shows the plastic strain, which follows from F.
  const FrameFields fields{false, false, out.report() != nullptr};
  const HiddenCase hidden = draw_hidden_case(options.hidden, material, fields);
  row.shape = hidden.observed.record.shape;
  row.other_shape = hidden.other.record.shape;
  const Observation whole = observation_of(hidden);
  write_observation(folder / "observation.h5", laboratory_view(whole, options.view));

  // From here on inference knows nothing but that file and the model.
  const std::string name = (folder / "observation.h5").string();
  const Observation observation = read_observation(name);
  std::fprintf(stderr, "%s\n", row.material.c_str());
  const Inference result = infer(observation, name, variables, options.fit, {}, options.adaptation);
  write_latent(folder / "latent.h5",
               latent_of(result, observation, variables, options.variables.model.string(),
                         out.config_yaml()));
  pictured.whole = observed_trajectory(whole);
  write_trajectory(folder / "truth.h5", pictured.whole);
  pictured.fitted = all_particles(whole, result, name, options.fit.dtype, fields.F);
  write_trajectory(folder / "fitted.h5", pictured.fitted);
  plot_chart(folder / "loss.png", loss_chart(result.fit, variables, row.material));
  row.noise_share = result.check.noise / result.size;
  row.fit_mse = result.fit_mse;
  row.fit_share = std::sqrt(result.fit_mse) / result.size;
  const TrajectoryComparison seen = compare_trajectories(
      pictured.fitted, pictured.whole, FrameMatch::all, "the fitted motion", "the true one");
  row.found_mse = seen.position_mse;
  row.found_share = seen.root_over_size;
  row.roll_outs = static_cast<std::size_t>(result.roll_outs);
  name_material(hidden, observation, result, row);
  for (const std::string& warning : fit_warnings(result, observation, variables)) {
    std::fprintf(stderr, "warning: %s: %s\n", name.c_str(), warning.c_str());
  }
  row.other_best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < variables.starts(); ++i) {
    if (variables.label(i) == row.material || is_random_law(variables.label(i))) continue;
    row.other_best = std::min(row.other_best, result.fit.start_mse[i]);
  }
  row.beats_other = row.fit_mse < row.other_best;

  pictured.material = row.material;
  pictured.observed = observed_trajectory(observation);
  pictured.best = best_so_far(result.fit);
  pictured.truth = hidden.other_truth;
  write_trajectory(folder / "other_truth.h5", hidden.other_truth);
  pictured.predicted = predict(hidden, result.fit.law, fields);
  write_trajectory(folder / "resimulated.h5", pictured.predicted);
  const TrajectoryComparison comparison =
      compare_trajectories(pictured.predicted, hidden.other_truth, FrameMatch::all,
                           "the re-simulation", "the analytic one");
  row.resim_mse = comparison.position_mse;
  row.resim_share = comparison.root_over_size;
  row.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  row.memory_mb = peak_memory_mb();
  return found;
}

CaseResult resumed_or_identified(const IdentifyOptions& options, std::int64_t material,
                                 const FitVariables& variables, const std::string& fingerprint,
                                 const RunDirectory& out) {
  const std::string name = options.hidden.draw.materials[material].name();
  const std::filesystem::path folder = out.file(name);
  if (auto finished = read_case_result(folder, fingerprint)) {
    std::fprintf(stderr, "%s: finished by the interrupted run\n", name.c_str());
    return *std::move(finished);
  }
  CaseResult found = identify_one(options, material, variables, out);
  write_case_result(folder, found, fingerprint);
  return found;
}

void add_row(Metrics& metrics, const Identified& row) {
  const auto set = [&](const char* name, double value) {
    metrics.set(fmt::format("{}.{}", name, row.material), value);
  };
  set("noise_over_size", row.noise_share);
  set("fit_mse", row.fit_mse);
  set("found_mse", row.found_mse);
  set("resim_mse", row.resim_mse);
  set("fit_beats_other", row.beats_other ? 1 : 0);
  set("fit_root_over_size", row.fit_share);
  set("found_root_over_size", row.found_share);
  set("named_right", row.named_right ? 1 : 0);
  set("resim_root_over_size", row.resim_share);
  set("other_best_mse", row.other_best);
  set("roll_outs", static_cast<double>(row.roll_outs));
  set("seconds", row.wall_s);
  set("memory_mb", row.memory_mb);
}

/// Observed beside fitted beside predicted, of every material.
void show_motions(const std::vector<Identified>& rows, const std::vector<CasePictures>& all,
                  const kernels::GridSettings& grid, Report& report) {
  for (const CasePictures& p : all) {
    const auto row = std::find_if(rows.begin(), rows.end(),
                                  [&](const Identified& r) { return r.material == p.material; });
    Playback playback;
    playback.title = fmt::format("{}: {}, then {}", p.material, row->shape, row->other_shape);
    playback.low = grid.bound * grid.dx();
    playback.high = 1 - playback.low;
    playback.motions = {
        motion_of("observed", p.observed), motion_of("fitted", p.fitted, "truth", p.whole),
        motion_of("predicted", p.predicted, "truth", p.truth), motion_of("truth", p.truth)};
    report.playbacks.push_back(std::move(playback));
  }
}

void draw_pictures(const std::vector<CasePictures>& all, RunDirectory& out) {
  Chart chart;
  chart.title = "Loss of the result's candidate; it rises where the horizon grows";
  chart.x_label = "roll-outs with gradients";
  chart.y_label = "position mse up to the horizon (m^2)";
  chart.log_y = true;
  std::vector<ParticlePanel> panels;
  for (const CasePictures& p : all) {
    Series series;
    series.label = p.material;
    for (std::size_t i = 0; i < p.best.size(); ++i) {
      series.x.push_back(static_cast<double>(i + 1));
      series.y.push_back(p.best[i]);
    }
    chart.series.push_back(series);
    // Two instants each: a third of the way, and the end.
    for (const auto& [name, trajectory] :
         {std::pair<const char*, const Trajectory*>{"observed", &p.observed},
          {"fitted", &p.fitted},
          {"re-simulated", &p.predicted},
          {"true there", &p.truth}}) {
      if (trajectory->frames == 0) continue;
      const ParticlePicture strip = frames_picture({{"", trajectory}}, 4);
      for (const int k : {1, 3}) {
        panels.push_back(strip.panels[k]);
        panels.back().caption = fmt::format("{} {}{}", p.material, name, strip.panels[k].caption);
      }
    }
  }
  out.draw("loss.png", chart);
  ParticlePicture picture;
  picture.columns = 8;
  picture.colour_label = kHeightInBody;
  picture.panel_pixels = 290;
  picture.low = 0.13;  // the walls stand at 0.15
  picture.high = 0.87;
  picture.panels = std::move(panels);
  plot_particles(out.file("strip.png"), picture);
}

}  // namespace

void identify(const IdentifyOptions& options, RunDirectory& out, Metrics& metrics) {
  const auto variables = options.variables.load();
  // The scenes follow from the configuration.
  const std::string fingerprint = fit_fingerprint({}, *variables, out.config_yaml());
  std::vector<Identified> rows;
  std::vector<CasePictures> pictures;
  std::string failures;
  const auto count = static_cast<std::int64_t>(options.hidden.draw.materials.size());
  for (std::int64_t material = 0; material < count; ++material) {
    const std::string name = options.hidden.draw.materials[material].name();
    Identified row;
    try {
      CaseResult found = resumed_or_identified(options, material, *variables, fingerprint, out);
      row = found.row;
      pictures.push_back(std::move(found.pictures));
    } catch (const Error& error) {
      row.material = name;
      forget_numbers(row);
      failures += fmt::format("; {}: {}", row.material, error.what());
    }
    add_row(metrics, row);
    rows.push_back(row);
  }
  const std::string table = identify_table(rows);
  out.write_table("table.md", "What was identified", table);
  std::fputs(table.c_str(), stdout);
  if (!pictures.empty()) draw_pictures(pictures, out);
  if (out.report()) show_motions(rows, pictures, options.hidden.draw.grid, *out.report());
  if (!failures.empty()) {
    metrics.write(out.file("metrics.json"));
    throw Error(failures.substr(2));
  }
  for (const Identified& row : rows) forget_case_result(out.file(row.material));
}

}  // namespace uniphy
