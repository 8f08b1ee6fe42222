#include "uniphy/data/dataset_setup.hpp"

#include <fmt/format.h>

#include <cmath>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

/// Equal but for the rounding of the mathematical library.
bool same_parameters(const MaterialParameters& a, const MaterialParameters& b) {
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (std::isnan(a[k]) != std::isnan(b[k])) return false;
    if (!std::isnan(a[k]) && !(std::abs(a[k] - b[k]) <= 1e-9 * std::abs(a[k]))) return false;
  }
  return true;
}

}  // namespace

TrajectorySetup setup_of(const Dataset& dataset, std::int64_t trajectory) {
  Config config = Config::parse(dataset.config, "config of the data set");
  Section root = config.root();
  const GenerateOptions options = read_generate_options(root);
  config.finish();
  const auto count = static_cast<std::int64_t>(dataset.trajectories.size());
  if (options.total() != count || trajectory < 0 || trajectory >= count) {
    throw Error(
        fmt::format("data set: trajectory {}: expected one of {} trajectories that the "
                    "configuration of the data set draws, found {}",
                    trajectory, options.total(), count));
  }
  const TrajectoryRecord& record = dataset.trajectories[static_cast<std::size_t>(trajectory)];
  if (trajectory >= options.simulated()) {
    throw Error(
        fmt::format("data set: trajectory {}: expected one of the {} that were simulated, found a "
                    "{}, which has no scene",
                    trajectory, options.simulated(), record.material));
  }
  TrajectorySetup setup = draw_setup(options, trajectory, record.attempt);
  if (setup.record.material != record.material || setup.record.shape != record.shape ||
      !same_parameters(setup.record.parameters, record.parameters)) {
    throw Error(fmt::format(
        "data set: trajectory {}: expected {} {}, as this version draws it, "
        "found {} {} or other parameters",
        trajectory, setup.record.material, setup.record.shape, record.material, record.shape));
  }
  return setup;
}

}  // namespace uniphy
