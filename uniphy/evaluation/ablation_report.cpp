#include "uniphy/evaluation/ablation_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "uniphy/evaluation/error_table.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy {
namespace {

double value(const AblationRow& row, const std::string& name) {
  return row.metrics.find(name).value_or(std::numeric_limits<double>::quiet_NaN());
}

void plot(const std::vector<AblationRow>& rows, const std::string& error, const std::string& title,
          const std::string& y_label, const std::string& png, const RunDirectory& out) {
  Chart chart;
  chart.title = title;
  chart.x_label = "cost of the law, ns a particle and step, one core";
  chart.y_label = y_label;
  chart.log_x = chart.log_y = true;
  for (const AblationRow& row : rows) {
    const auto at = std::find_if(chart.series.begin(), chart.series.end(),
                                 [&](const Series& s) { return s.label == row.variant.group; });
    Series& series = at != chart.series.end() ? *at : chart.series.emplace_back();
    series.label = row.variant.group;
    series.points = true;
    series.x.push_back(value(row, "law_ns"));
    series.y.push_back(value(row, error));
    series.names.push_back(row.variant.name);
  }
  out.draw(png, chart);
}

}  // namespace

std::string ablation_table(const std::vector<AblationRow>& rows,
                           const std::vector<std::string>& materials) {
  std::string text =
      "| variant | form | width | latent | data | parameters | steps | training (s) | law (ns) | "
      "stress | projection | roll-out | not finished |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const AblationRow& row : rows) {
    const models::LearnedLawOptions& n = row.variant.training.law;
    text += fmt::format(
        "| {} | {} | {} x {} | {} | {} x {} | {:g} | {:g} | {:.0f} | {:.0f} | {} | "
        "{} | {} | {:g} |\n",
        row.variant.name, kernels::form_name(n.form), n.hidden_layers, n.width, n.latent_size,
        materials.size(), row.variant.trajectories, value(row, "parameters"), value(row, "steps"),
        value(row, "train_s"), value(row, "law_ns"), percent(value(row, "stress_error")),
        percent(value(row, "projection_error")), percent(value(row, "rollout_error")),
        value(row, "rollouts_failed"));
  }
  text +=
      "\nMedians over all held-out trajectories, of the projection over those that project. By "
      "material, the worst in brackets:\n";
  for (const auto& [title, error] :
       {std::pair{"Roll-out", "rollout_error"},
        {"Stress", "stress_error"},
        {"Projection, of trajectories that project", "projection_error"},
        {"Projection, absolute, of those that do not", "unprojected_error"}}) {
    std::vector<ErrorRow> lines;
    for (const AblationRow& row : rows) lines.push_back({row.variant.name, &row.metrics, error});
    text += fmt::format("\n{}:\n\n", title) + error_table(lines, materials);
  }
  return text;
}

std::string ablation_csv(const std::vector<AblationRow>& rows) {
  if (rows.empty()) return "";
  std::string csv = "variant,group,form,activation,layers,width,latent_size,trajectories";
  for (const auto& [name, unused] : rows.front().metrics.entries()) csv += "," + name;
  csv += "\n";
  for (const AblationRow& row : rows) {
    const models::LearnedLawOptions& n = row.variant.training.law;
    csv += fmt::format("{},{},{},{},{},{},{},{}", row.variant.name, row.variant.group,
                       kernels::form_name(n.form), kernels::activation_name(n.activation),
                       n.hidden_layers, n.width, n.latent_size, row.variant.trajectories);
    for (const auto& [name, unused] : rows.front().metrics.entries()) {
      csv += fmt::format(",{:.6g}", value(row, name));
    }
    csv += "\n";
  }
  return csv;
}

void plot_against_cost(const std::vector<AblationRow>& rows, const RunDirectory& out) {
  plot(rows, "rollout_error", "Roll-out error against cost",
       "median of root of position mse / object size", "rollout_against_cost.png", out);
  plot(rows, "stress_error", "Stress error against cost", "median of RMS error / RMS stress",
       "stress_against_cost.png", out);
}

}  // namespace uniphy
