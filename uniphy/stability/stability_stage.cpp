#include "uniphy/stability/stability_stage.hpp"

#include <ATen/Parallel.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/progress.hpp"
#include "uniphy/stability/finished_cells.hpp"
#include "uniphy/stability/horizon_cells.hpp"
#include "uniphy/stability/impact_cells.hpp"
#include "uniphy/stability/latent_cells.hpp"
#include "uniphy/stability/precision_cells.hpp"
#include "uniphy/stability/spectral_cells.hpp"
#include "uniphy/stability/stability_report.hpp"
#include "uniphy/stability/time_step_cells.hpp"

namespace uniphy::stability {
namespace {

Plan plan_of(const StabilityOptions& o, const Subjects& subjects) {
  struct Stressor {
    const char* name;
    Plan (*cells)(const StabilityOptions&, const Subjects&);
  };
  constexpr Stressor kStressors[] = {{"spectral", spectral_cells}, {"time_step", time_step_cells},
                                     {"impacts", impact_cells},    {"latents", latent_cells},
                                     {"horizons", horizon_cells},  {"precision", precision_cells}};
  Plan plan;
  for (const Stressor& stressor : kStressors) {
    if (std::find(o.stressors.begin(), o.stressors.end(), stressor.name) == o.stressors.end())
      continue;
    for (PlannedCell& cell : stressor.cells(o, subjects)) plan.push_back(std::move(cell));
  }
  // Rows in one piece, in the order of their first cell.
  std::vector<std::string> rows;
  for (const PlannedCell& cell : plan) {
    if (std::find(rows.begin(), rows.end(), cell.stressor) == rows.end())
      rows.push_back(cell.stressor);
  }
  const auto place = [&](const PlannedCell& cell) {
    return std::find(rows.begin(), rows.end(), cell.stressor) - rows.begin();
  };
  std::stable_sort(plan.begin(), plan.end(),
                   [&](const PlannedCell& a, const PlannedCell& b) { return place(a) < place(b); });
  return plan;
}

void write(const std::vector<Cell>& cells, RunDirectory& out) {
  out.write_table("stability.md", "Stability", survival_table(cells));
  write_text_file(out.file("stability.csv"), numbers_csv(cells));
  write_text_file(out.file("failures.csv"), failures_csv(cells));
}

void run(const StabilityOptions& o, RunDirectory& out, Metrics& metrics) {
  at::set_num_threads(out.threads());
  const Subjects subjects = load_subjects(o);
  const Plan plan = plan_of(o, subjects);
  const FinishedCells finished(out.file("cells"));
  std::vector<Cell> cells;
  Progress progress("stability", static_cast<std::int64_t>(plan.size()), "cells");
  for (const PlannedCell& planned : plan) {
    progress.update(static_cast<std::int64_t>(cells.size()),
                    fmt::format("{} {} {}", planned.stressor, planned.method, planned.setting));
    std::optional<Cell> cell =
        finished.find(planned.stressor, planned.method, planned.setting, planned.settings);
    if (!cell) {
      cell.emplace();
      cell->stressor = planned.stressor;
      cell->method = planned.method;
      cell->setting = planned.setting;
      planned.measure(*cell);
      finished.keep(*cell, planned.settings);
    }
    if (!cells.empty() && cells.back().stressor != cell->stressor) write(cells, out);
    cells.push_back(*std::move(cell));
  }
  progress.update(static_cast<std::int64_t>(cells.size()));
  progress.finish();
  write(cells, out);
  plot_map(out.file("survival.png"), survival_map(cells));
  add_stability_metrics(cells, metrics);
  metrics.set("cells", static_cast<double>(cells.size()));
  std::fputs(survival_table(cells).c_str(), stdout);
}

}  // namespace

RunFunction stability_stage(Section& config) {
  const StabilityOptions o = read_stability_options(config);
  return [o](RunDirectory& out, Metrics& metrics) { run(o, out, metrics); };
}

}  // namespace uniphy::stability
