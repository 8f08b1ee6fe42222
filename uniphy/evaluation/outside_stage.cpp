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
#include "uniphy/evaluation/outside_report.hpp"
#include "uniphy/evaluation/outside_scenes.hpp"
#include "uniphy/inference/adaptation_state.hpp"
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

/// The lines of one section of a resolved configuration.
std::string section_text(const std::string& yaml, const std::string& key) {
  const std::size_t begin = yaml.find("\n" + key + ":");
  if (begin == std::string::npos) return {};
  std::size_t end = yaml.find('\n', begin + 1);
  while (end != std::string::npos && end + 1 < yaml.size() && yaml[end + 1] == ' ')
    end = yaml.find('\n', end + 1);
  return yaml.substr(begin + 1, end - begin - 1);
}

/// Finished fits on disk.
class FitStore {
 public:
  explicit FitStore(const RunDirectory& out)
      : folder_(out.file("fits")),
        settings_(section_text(out.config_yaml(), "fit") +
                  section_text(out.config_yaml(), "adaptation")) {
    make_directory(folder_);
  }

  /// Where the fit is kept, without an ending.
  std::filesystem::path stem(const OutsideCell& cell, const Observation& seen,
                             const FitVariables& variables) const {
    return folder_ / fmt::format("{}.{}.{}-{}", cell.law, cell.scene, cell.fitted,
                                 fit_fingerprint(seen, variables, settings_));
  }

  static void write(const std::filesystem::path& stem, const OutsideCell& cell) {
    Metrics m;
    m.set("fit", cell.result.fit);
    m.set("forecast", cell.result.forecast);
    m.set("rung", cell.result.rung);
    m.set("explained", cell.result.explained ? 1 : 0);
    m.set("nearest", cell.result.nearest);
    m.set("roll_outs", cell.result.roll_outs);
    m.set("seconds", cell.seconds);
    m.write(file(stem));
  }

  static bool read(const std::filesystem::path& stem, OutsideCell& cell) {
    if (!std::filesystem::exists(file(stem))) return false;
    const Metrics m = Metrics::read(file(stem));
    const auto number = [&](const char* name) {
      const auto value = m.find(name);
      if (!value) throw Error(fmt::format("{}: {}: missing", file(stem).string(), name));
      return std::isnan(*value) ? kInfinity : *value;  // JSON has no infinity
    };
    cell.result.fit = number("fit");
    cell.result.forecast = number("forecast");
    cell.result.rung = static_cast<int>(number("rung"));
    cell.result.explained = number("explained") != 0;
    cell.result.nearest = static_cast<int>(number("nearest"));
    cell.result.roll_outs = number("roll_outs");
    cell.seconds = number("seconds");
    return true;
  }

 private:
  static std::filesystem::path file(std::filesystem::path stem) { return stem += ".json"; }

  std::filesystem::path folder_;
  std::string settings_;
};

/// Fits, or says why that failed.
Forecast forecast_or_failure(const OutsideCell& cell, const Observation& seen,
                             const FitVariables& variables, const OutsideOptions& o,
                             const FitHooks& hooks) {
  const std::string name = fmt::format("{} in {}", cell.law, cell.scene);
  try {
    return forecast(seen, name, variables, o.fit, o.adaptation, hooks);
  } catch (const Error& error) {
    std::fprintf(stderr, "warning: %s fitted by %s: %s\n", name.c_str(), cell.fitted.c_str(),
                 error.what());
    Forecast failed;
    failed.fit = failed.forecast = kInfinity;
    failed.explained = false;
    return failed;
  }
}

OutsideCell make_cell(const Motion& motion, const Contender& by, const Observation& seen,
                      const OutsideOptions& o, const FitStore& store) {
  OutsideCell cell;
  cell.law = motion.law;
  cell.scene = motion.scene;
  cell.fitted = by.name;
  const std::filesystem::path stem = store.stem(cell, seen, *by.variables);
  if (!FitStore::read(stem, cell)) {
    const auto start = std::chrono::steady_clock::now();
    FitHooks hooks;
    hooks.state_file = stem;
    hooks.state_file += ".state.h5";
    hooks.fingerprint = stem.filename().string();
    cell.result = forecast_or_failure(cell, seen, *by.variables, o, hooks);
    cell.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    FitStore::write(stem, cell);
    std::error_code ignored;
    std::filesystem::remove(hooks.state_file, ignored);
    std::filesystem::remove(adaptation_state_file(hooks.state_file), ignored);
  }
  if (by.name == kLearnedLaw && cell.result.nearest >= 0)
    cell.named = by.variables->label(cell.result.nearest);
  return cell;
}

void run(const OutsideOptions& o, RunDirectory& out, Metrics& metrics) {
  at::set_num_threads(out.threads());
  const std::vector<Contender> all = contenders(o);
  const FitStore store(out);
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
      cells.push_back(make_cell(motion, by, *seen, o, store));
    }
    if (cells.empty()) continue;
    // After each, so that there is something to look at meanwhile.
    write_text_file(out.file("outside.md"), outside_table(cells));
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
