#include <fmt/format.h>

#include <cmath>
#include <fstream>

#include "ops/kernels/error.hpp"
#include "uniphy/report/experiment.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/scene/comparison.hpp"

namespace {

void write_curve(const uniphy::TrajectoryComparison& comparison,
                 const std::filesystem::path& file) {
  std::ofstream stream(file);
  stream << "time_s,mse_m2,root_m\n";
  for (std::size_t frame = 0; frame < comparison.time.size(); ++frame) {
    const double mse = comparison.frame_mse[frame];
    stream << fmt::format("{},{},{}\n", comparison.time[frame], mse, std::sqrt(mse));
  }
  if (!stream.flush()) throw uniphy::Error(file.string() + ": cannot be written");
}

void plot_curve(const uniphy::TrajectoryComparison& comparison, const std::filesystem::path& file) {
  uniphy::Series series;
  for (std::size_t frame = 0; frame < comparison.time.size(); ++frame) {
    // A logarithmic axis has no place for the zeros of equal frames.
    if (!(comparison.frame_mse[frame] > 0)) continue;
    series.x.push_back(comparison.time[frame]);
    series.y.push_back(std::sqrt(comparison.frame_mse[frame]) / comparison.size);
  }
  if (series.x.empty()) return;
  uniphy::Chart chart;
  chart.title = "Distance from the reference";
  chart.x_label = "time, s";
  chart.y_label = "root of the mean squared error / size of the object";
  chart.log_y = true;
  chart.series.push_back(series);
  uniphy::plot_chart(file, chart);
}

}  // namespace

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_evaluate",
      "Compares a trajectory with another of the same particles. position_mse is the mean over "
      "frames, particles and coordinates of the squared difference, in m^2 of the unit cube; "
      "root_over_size its root divided by the largest side of the object in the first frame.",
      {"two trajectories (trajectory.h5)"},
      {"DIR/curve.csv       mean squared error of every frame",
       "DIR/curve.png       its root over the size of the object",
       "DIR/metrics.json    position_mse, root_mse, root_over_size, largest_distance, final_mse,",
       "                    size, frames, and position_mse.BODY where there are several"},
      {"uniphy_evaluate configs/evaluate/trajectory.yaml --set trajectory=out/resim/trajectory.h5 "
       "--set reference=out/truth/trajectory.h5"}};
  return uniphy::run_experiment(
      argc, argv, info, [](uniphy::Section& config) -> uniphy::RunFunction {
        const std::filesystem::path predicted =
            config.input_file("trajectory", uniphy::required, "what is judged");
        const std::filesystem::path reference =
            config.input_file("reference", uniphy::required, "what it should be");
        const std::string frames =
            config.choice("frames", std::string("all"), {"all", "common"},
                          "all: the times must be the same; common: those that both have");
        return [=](uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
          const auto comparison = uniphy::compare_trajectories(
              uniphy::read_trajectory(predicted, true), uniphy::read_trajectory(reference, true),
              frames == "common" ? uniphy::FrameMatch::common : uniphy::FrameMatch::all,
              predicted.string(), reference.string());
          metrics.set("position_mse", comparison.position_mse);
          metrics.set("root_mse", std::sqrt(comparison.position_mse));
          metrics.set("root_over_size", comparison.root_over_size);
          metrics.set("size", comparison.size);
          metrics.set("largest_distance", comparison.largest_distance);
          metrics.set("final_mse", comparison.final_mse);
          metrics.set("frames", static_cast<double>(comparison.time.size()));
          for (std::size_t b = 0; comparison.body_mse.size() > 1 && b < comparison.body_mse.size();
               ++b) {
            metrics.set(fmt::format("position_mse.{}", b), comparison.body_mse[b]);
          }
          write_curve(comparison, out.file("curve.csv"));
          plot_curve(comparison, out.file("curve.png"));
          fmt::print("position_mse {:.6g} m^2, root/size {:.4g}\n", comparison.position_mse,
                     comparison.root_over_size);
        };
      });
}
