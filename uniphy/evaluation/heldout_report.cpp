#include "uniphy/evaluation/heldout_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "uniphy/inference/infer_run.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy {
namespace {

/// In quotes, for texts with commas.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? "'" : std::string(1, c);
  return out + "\"";
}

void plot_values(const EvaluatedSet& set, const std::vector<double>& values,
                 const std::string& title, const std::string& y_label, const std::string& png,
                 const RunDirectory& out) {
  std::map<std::string, std::vector<double>> of;
  std::vector<std::string> order;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string& material = set.data.trajectories[i].material;
    if (of.count(material) == 0) order.push_back(material);
    if (std::isfinite(values[i]))
      of[material].push_back(values[i]);
    else
      of[material];
  }
  Chart chart;
  chart.title = title;
  chart.x_label = "trajectory, in the order of its error within its material";
  chart.y_label = y_label;
  chart.log_y = true;
  double x = 0;
  for (const std::string& material : order) {
    std::vector<double>& list = of[material];
    std::sort(list.begin(), list.end());
    Series series;
    series.label = material;
    series.points = true;
    for (const double value : list) {
      series.x.push_back(++x);
      series.y.push_back(value);
    }
    chart.series.push_back(std::move(series));
  }
  out.draw(png, chart);
}

}  // namespace

std::vector<double> EvaluatedSet::rollout_values() const {
  std::vector<double> values;
  for (const RolloutError& e : rollouts) values.push_back(e.root_over_size);
  return values;
}

std::int64_t EvaluatedSet::failed() const {
  return std::count_if(rollouts.begin(), rollouts.end(),
                       [](const RolloutError& e) { return !e.failure.empty(); });
}

std::string errors_csv(const std::vector<EvaluatedSet>& sets) {
  std::string csv = "set,trajectory,material,shape,motion";
  for (const kernels::LawParameter& p : kernels::kLawParameterTable) {
    if (p.place >= kernels::kFamilyParameters) break;
    csv += fmt::format(",{}", p.name);
  }
  csv += ",dt,stress_error,projection_error,rollout_error,failure,z\n";
  for (const EvaluatedSet& set : sets) {
    for (std::size_t i = 0; i < set.rollouts.size(); ++i) {
      const TrajectoryRecord& record = set.data.trajectories[i];
      csv += fmt::format("{},{},{},{},{}", set.name, i, record.material, record.shape,
                         set.setups[i].motion);
      for (const double value : record.parameters) {
        csv += std::isnan(value) ? "," : fmt::format(",{:.9g}", value);
      }
      csv += fmt::format(",{:.9g},{:.6g},{:.6g},{:.6g},{},", record.dt, set.law[i].stress,
                         set.law[i].projection, set.rollouts[i].root_over_size,
                         quoted(set.rollouts[i].failure));
      for (std::size_t k = 0; k < set.laws[i].z.size(); ++k) {
        csv += fmt::format("{}{:.6g}", k == 0 ? "" : " ", set.laws[i].z[k]);
      }
      csv += "\n";
    }
  }
  return csv;
}

void plot_errors(const EvaluatedSet& set, const std::string& prefix, const RunDirectory& out) {
  std::vector<double> stress;
  for (const LawError& e : set.law) stress.push_back(e.stress);
  const std::string failed =
      set.failed() == 0 ? "" : fmt::format(" ({} did not finish)", set.failed());
  plot_values(set, set.rollout_values(), "Roll-outs with the fitted code, " + set.name + failed,
              "root of position mse / object size", prefix + "rollout_errors.png", out);
  plot_values(set, stress, "Stress of the fitted code, " + set.name, "RMS error / RMS stress",
              prefix + "stress_errors.png", out);
}

void plot_worst(const std::vector<EvaluatedSet>& sets, const RunDirectory& out) {
  const EvaluatedSet* of = nullptr;
  std::size_t worst = 0;
  for (const EvaluatedSet& set : sets) {
    for (std::size_t i = 0; i < set.rollouts.size(); ++i) {
      const RolloutError& e = set.rollouts[i];
      if (!e.failure.empty()) continue;
      if (of && e.root_over_size <= of->rollouts[worst].root_over_size) continue;
      of = &set;
      worst = i;
    }
  }
  if (of == nullptr) return;
  const TrajectorySetup& setup = of->setups[worst];
  const Trajectory truth = roll_out(setup, setup.law()), learned = roll_out(setup, of->laws[worst]);
  ParticlePicture picture = frames_picture({{"analytic", &truth}, {"learned", &learned}}, 6);
  picture.title =
      fmt::format("The worst roll-out: {} {} of {}, {:.2g} % of its size", setup.record.material,
                  setup.record.shape, of->name, 100 * of->rollouts[worst].root_over_size);
  plot_particles(out.file("worst_rollout.png"), picture);
  if (out.report()) {
    out.report()->playbacks.push_back(
        {picture.title,
         {motion_of("analytic", truth), motion_of("learned", learned, "analytic", truth)}});
  }
}

}  // namespace uniphy
