#include "uniphy/evaluation/evaluate_stage.hpp"

#include <fmt/format.h>

#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "uniphy/evaluation/heldout_stage.hpp"
#include "uniphy/evaluation/materials_stage.hpp"
#include "uniphy/evaluation/open_world_stage.hpp"
#include "uniphy/evaluation/outside_stage.hpp"
#include "uniphy/evaluation/touching_stage.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/scene/comparison.hpp"

namespace uniphy {
namespace {

void write_curve(const TrajectoryComparison& comparison, const std::filesystem::path& file) {
  std::string text = "time_s,mse_m2,root_m\n";
  for (std::size_t frame = 0; frame < comparison.time.size(); ++frame) {
    const double mse = comparison.frame_mse[frame];
    text += fmt::format("{},{},{}\n", comparison.time[frame], mse, std::sqrt(mse));
  }
  write_text_file(file, text);
}

void plot_curve(const TrajectoryComparison& comparison, const RunDirectory& out) {
  Series series;
  for (std::size_t frame = 0; frame < comparison.time.size(); ++frame) {
    // A logarithmic axis has no place for the zeros of equal frames.
    if (!(comparison.frame_mse[frame] > 0)) continue;
    series.x.push_back(comparison.time[frame]);
    series.y.push_back(std::sqrt(comparison.frame_mse[frame]) / comparison.size);
  }
  if (series.x.empty()) return;
  Chart chart;
  chart.title = "Distance from the reference";
  chart.x_label = "time, s";
  chart.y_label = "root of the mean squared error / size of the object";
  chart.log_y = true;
  chart.series.push_back(series);
  out.draw("curve.png", chart);
}

// With a word where it is only the beginning of a run.
Trajectory read_compared(const std::filesystem::path& file, bool warn) {
  Trajectory trajectory = read_trajectory(file, true);
  if (warn && !trajectory.failure.empty()) {
    fmt::print(stderr, "warning: {}: ends at {:.6g} s because its run failed: {}\n", file.string(),
               trajectory.time.back(), trajectory.failure);
  }
  return trajectory;
}

RunFunction trajectory_stage(Section& config) {
  const std::filesystem::path predicted =
      config.input_file("trajectory", required, "what is judged");
  const std::filesystem::path reference =
      config.input_file("reference", required, "what it should be");
  const std::string frames =
      config.choice("frames", std::string("all"), {"all", "common"},
                    "all: the times must be the same; common: those that both have");
  return [=](RunDirectory& out, Metrics& metrics) {
    const bool common = frames == "common";
    const Trajectory judged = read_compared(predicted, common);
    const Trajectory truth = read_compared(reference, common);
    const auto comparison =
        compare_trajectories(judged, truth, common ? FrameMatch::common : FrameMatch::all,
                             predicted.string(), reference.string());
    metrics.set("position_mse", comparison.position_mse);
    metrics.set("root_mse", std::sqrt(comparison.position_mse));
    metrics.set("root_over_size", comparison.root_over_size);
    metrics.set("size", comparison.size);
    metrics.set("largest_distance", comparison.largest_distance);
    metrics.set("final_mse", comparison.final_mse);
    metrics.set("frames", static_cast<double>(comparison.time.size()));
    for (std::size_t b = 0; comparison.body_mse.size() > 1 && b < comparison.body_mse.size(); ++b) {
      metrics.set(fmt::format("position_mse.{}", b), comparison.body_mse[b]);
    }
    write_curve(comparison, out.file("curve.csv"));
    plot_curve(comparison, out);
    if (out.report()) {
      out.report()->playbacks.push_back(
          {"Comparison",
           {motion_of("judged", judged, "reference", truth), motion_of("reference", truth)}});
    }
    fmt::print("position_mse {:.6g} m^2, root/size {:.4g}\n", comparison.position_mse,
               comparison.root_over_size);
  };
}

}  // namespace

RunFunction evaluate_stage(Section& config) {
  RunFunction run;
  config.variant(
      "kind", std::string("trajectory"),
      {{"trajectory", "one trajectory against another",
        [&run](Section& keys) { run = trajectory_stage(keys); }},
       {"heldout", "a trained law on materials, shapes and motions it never saw",
        [&run](Section& keys) { run = heldout_stage(keys); }},
       {"outside", "forecasts of motions by laws that the trained one was not built around",
        [&run](Section& keys) { run = outside_stage(keys); }},
       {"open_world", "forecasts from what a laboratory sees: noise, tracked points, finer truths",
        [&run](Section& keys) { run = open_world_stage(keys); }},
       {"touching", "two bodies of two materials that push each other, a code for each",
        [&run](Section& keys) { run = touching_stage(keys); }},
       {"materials", "what held-out objects are made of, read off their motion, with intervals",
        [&run](Section& keys) { run = materials_stage(keys); }}},
      "what is evaluated");
  return run;
}

}  // namespace uniphy
