#include "uniphy/data/generate.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <mutex>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/hash.hpp"
#include "uniphy/data/dataset_metrics.hpp"
#include "uniphy/data/part_file.hpp"
#include "uniphy/data/random_streams.hpp"
#include "uniphy/data/simulate_samples.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/for_each_with_progress.hpp"

namespace uniphy {
namespace {

std::string describe(const TrajectorySetup& setup) {
  std::string text = setup.record.material;
  for (const kernels::LawParameter& p : kernels::law_parameters(setup.law().id))
    text += fmt::format(", {} {:.4g}", p.name, setup.record.parameters[p.place]);
  return fmt::format("{}, {} {}", text, setup.motion, setup.record.shape);
}

TrajectoryPart make_trajectory(const GenerateOptions& options, std::int64_t trajectory) {
  TrajectoryPart part;
  for (; part.attempt < options.attempts; ++part.attempt) {
    const TrajectorySetup setup = draw_setup(options, trajectory, part.attempt);
    try {
      part.samples = trajectory_samples(
          options, setup,
          stream_seed(scramble(options.seed) ^ static_cast<std::uint64_t>(options.split),
                      Stream::sampling, static_cast<std::uint64_t>(trajectory),
                      static_cast<std::uint64_t>(part.attempt)));
      return part;
    } catch (const Error& error) {
      part.failures.push_back(fmt::format("{}: {}", describe(setup), error.what()));
    }
  }
  throw Error(fmt::format("trajectory {} of {}: all {} attempts failed, the last one: {}",
                          trajectory, options.total(), options.attempts, part.failures.back()));
}

/// Runs what has no part yet, one trajectory a thread.
void make_parts(const GenerateOptions& options, const std::filesystem::path& directory) {
  const std::int64_t total = options.total();
  std::vector<std::int64_t> open;
  for (std::int64_t i = 0; i < total; ++i) {
    if (!std::filesystem::exists(part_path(directory, i))) open.push_back(i);
  }
  std::mutex one_at_a_time;  // HDF5 serves one thread at a time
  for_each_with_progress(
      "generate", "trajectories", static_cast<std::int64_t>(open.size()),
      [&](std::int64_t k) {
        const std::int64_t i = open[static_cast<std::size_t>(k)];
        const TrajectoryPart part = make_trajectory(options, i);
        const std::lock_guard<std::mutex> lock(one_at_a_time);
        for (const std::string& reason : part.failures) {
          std::fprintf(stderr, "left out: trajectory %lld: %s\n", static_cast<long long>(i),
                       reason.c_str());
        }
        write_part(part_path(directory, i), part);
      },
      total - static_cast<std::int64_t>(open.size()));
}

}  // namespace

void generate_dataset(const GenerateOptions& options, const std::string& config_yaml,
                      const std::filesystem::path& file, Metrics& metrics) {
  std::filesystem::path parts = file;
  parts += ".parts-" + kernels::Hash().add(config_yaml).text();
  make_directory(parts);
  make_parts(options, parts);

  DatasetWriter writer(file, config_yaml);
  DatasetMetrics collected(options);
  for (std::int64_t i = 0; i < options.total(); ++i) {
    const auto part = read_part(part_path(parts, i));
    if (!part) {
      throw Error(fmt::format("{}: removed while the data set was generated",
                              part_path(parts, i).string()));
    }
    const TrajectorySetup setup = draw_setup(options, i, part->attempt);
    writer.append(setup.record, part->samples);
    collected.add(setup, *part);
  }
  writer.finish();
  collected.write(metrics);
  std::filesystem::remove_all(parts);
}

Dataset drawn_dataset(const GenerateOptions& options, const std::filesystem::path& file,
                      Metrics* metrics) {
  const std::string config = generate_config(options);
  if (std::filesystem::exists(file)) {
    Dataset data = read_dataset(file);
    if (data.config == config) return data;
  }
  Metrics unused;
  generate_dataset(options, config, file, metrics ? *metrics : unused);
  return read_dataset(file);
}

}  // namespace uniphy
