#include "uniphy/evaluation/outside_stage.hpp"

#include <ATen/Parallel.h>
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <memory>
#include <optional>

#include "ops/kernels/base/error.hpp"
#include "uniphy/data/material_ranges.hpp"
#include "uniphy/evaluation/finished_fits.hpp"
#include "uniphy/evaluation/outside_report.hpp"
#include "uniphy/evaluation/outside_scenes.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A law that is fitted to the motions.
struct Contender {
  std::string name;
  std::unique_ptr<const FitVariables> variables;
};

std::vector<Contender> contenders(const OutsideOptions& o) {
  std::vector<Contender> all;
  all.push_back({kLearnedLaw, o.learned.load()});
  if (!o.analytic) return all;
  for (const MaterialRanges& ranges : default_material_ranges()) {
    FitVariablesSource source;
    source.id = ranges.id;
    source.ranges = default_ranges(ranges.id);
    source.starts = o.starts;
    source.seed = o.seed;
    all.push_back({ranges.name(), source.load()});
  }
  return all;
}

/// A motion, made when it is asked for.
struct Motion {
  std::string law, scene;
  std::string family;  ///< that is no wrong law for it
  std::function<Observation()> observe;
};

std::vector<Motion> motions(const OutsideOptions& o) {
  std::vector<Motion> all;
  const std::vector<OutsideScene> scenes = outside_scenes(o);
  for (const OutsideTruth& truth : o.laws) {
    const kernels::LawDescription law = truth.law.load();
    for (const OutsideScene& scene : scenes) {
      all.push_back({truth.name, scene.name, kernels::law_name(law.id),
                     [scene, law] { return observe(scene, law); }});
    }
  }
  for (const ObservedMotion& seen : o.observations) {
    all.push_back(
        {seen.name, "observed", seen.truth, [file = seen.file] { return read_observation(file); }});
  }
  return all;
}

OutsideCell make_cell(const Motion& motion, const Contender& by, const Observation& seen,
                      const OutsideOptions& o, const FinishedFits& finished) {
  OutsideCell cell;
  cell.law = motion.law;
  cell.scene = motion.scene;
  cell.fitted = by.name;
  const std::filesystem::path stem = finished.stem(
      fmt::format("{}.{}.{}", cell.law, cell.scene, cell.fitted), seen, *by.variables);
  if (!FinishedFits::read(stem, cell.result, cell.seconds)) {
    const auto start = std::chrono::steady_clock::now();
    const FitHooks hooks = FinishedFits::hooks(stem);
    cell.result = forecast_or_failure({seen, fmt::format("{} in {}", cell.law, cell.scene)},
                                      by.name, *by.variables, o.fit, o.adaptation, hooks);
    cell.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    FinishedFits::write(stem, cell.result, cell.seconds);
  }
  if (by.name == kLearnedLaw) cell.named = cell.result.material;
  return cell;
}

void run(const OutsideOptions& o, RunDirectory& out, Metrics& metrics) {
  at::set_num_threads(out.threads());
  const std::vector<Contender> all = contenders(o);
  const FinishedFits finished(out);
  const std::vector<Motion> todo = motions(o);
  const std::size_t fits = todo.size() * all.size();
  std::vector<OutsideCell> cells;
  std::size_t done = 0, failed = 0;
  std::string reason;
  for (const Motion& motion : todo) {
    std::optional<Observation> seen;
    try {
      seen = motion.observe();
    } catch (const Error& error) {
      std::fprintf(stderr, "warning: %s in %s: left out: %s\n", motion.law.c_str(),
                   motion.scene.c_str(), error.what());
      reason = error.what();
      ++failed;
    }
    for (const Contender& by : all) {
      ++done;
      if (!seen || by.name == motion.family) continue;
      std::fprintf(stderr, "%s in %s, by %s (%zu of %zu)\n", motion.law.c_str(),
                   motion.scene.c_str(), by.name.c_str(), done, fits);
      cells.push_back(make_cell(motion, by, *seen, o, finished));
    }
    if (cells.empty()) continue;
    // After each, so that there is something to look at meanwhile.
    out.write_table("outside.md", "Forecasts", outside_table(cells));
    write_text_file(out.file("outside.csv"), outside_csv(cells));
  }
  if (cells.empty()) throw Error("none of the motions could be made: " + reason);
  add_outside_metrics(cells, metrics);
  metrics.set("fits", static_cast<double>(cells.size()));
  metrics.set("motions_failed", static_cast<double>(failed));
  plot_outside(cells, out);
  std::fputs(outside_table(cells).c_str(), stdout);
}

}  // namespace

RunFunction outside_stage(Section& config) {
  const OutsideOptions o = read_outside_options(config);
  return [o](RunDirectory& out, Metrics& metrics) { run(o, out, metrics); };
}

}  // namespace uniphy
