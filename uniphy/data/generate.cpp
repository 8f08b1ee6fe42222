#include "uniphy/data/generate.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <mutex>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/hash.hpp"
#include "uniphy/data/dataset_metrics.hpp"
#include "uniphy/data/part_file.hpp"
#include "uniphy/data/random_law_samples.hpp"
#include "uniphy/data/random_row.hpp"
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

std::vector<std::int64_t> missing_parts(const std::filesystem::path& directory, std::int64_t first,
                                        std::int64_t last) {
  std::vector<std::int64_t> open;
  for (std::int64_t i = first; i < last; ++i) {
    if (!std::filesystem::exists(part_path(directory, i))) open.push_back(i);
  }
  return open;
}

/// Runs what has no part yet, one trajectory a thread.
void make_parts(const GenerateOptions& options, const std::filesystem::path& directory) {
  const std::int64_t total = options.simulated();
  const std::vector<std::int64_t> open = missing_parts(directory, 0, total);
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

/// A part that this run has written or found.
TrajectoryPart existing_part(const std::filesystem::path& directory, std::int64_t trajectory) {
  auto part = read_part(part_path(directory, trajectory));
  if (part) return *std::move(part);
  throw Error(fmt::format("{}: removed while the data set was generated",
                          part_path(directory, trajectory).string()));
}

/// The record of a law drawn at random: that of its base but for the name and the parameters.
TrajectoryRecord random_record(const RandomRow& row, TrajectoryRecord base) {
  base.material = random_law_name(row.kind);
  base.parameters = no_parameters();
  return base;
}

/// The laws drawn at random, once the trajectories that they take states from are there.
void make_random_parts(const GenerateOptions& options, const std::filesystem::path& directory) {
  const std::int64_t total = options.total() - options.simulated();
  if (total == 0) return;
  const std::vector<std::int64_t> open =
      missing_parts(directory, options.simulated(), options.total());
  std::mutex one_at_a_time;  // HDF5 serves one thread at a time
  for_each_with_progress(
      "generate", "random laws", static_cast<std::int64_t>(open.size()),
      [&](std::int64_t k) {
        const std::int64_t i = open[static_cast<std::size_t>(k)];
        const RandomRow row = random_row(options, i);
        std::unique_lock<std::mutex> lock(one_at_a_time);
        const TrajectoryPart base = existing_part(directory, row.base);
        lock.unlock();
        const TrajectoryRecord record = draw_setup(options, row.base, base.attempt).record;
        TrajectoryPart part;
        part.attempt = base.attempt;
        part.samples =
            draw_random_law(row.kind, base.samples, record.material, record.dt, row.seed).samples;
        lock.lock();
        write_part(part_path(directory, i), part);
      },
      total - static_cast<std::int64_t>(open.size()));
}

}  // namespace

std::filesystem::path parts_directory(std::filesystem::path file, const std::string& config_yaml) {
  return file += ".parts-" + kernels::Hash().add(config_yaml).text();
}

void generate_dataset(const GenerateOptions& options, const std::string& config_yaml,
                      const std::filesystem::path& file, Metrics& metrics) {
  const std::filesystem::path parts = parts_directory(file, config_yaml);
  make_directory(parts);
  make_parts(options, parts);
  make_random_parts(options, parts);

  DatasetWriter writer(file, config_yaml);
  DatasetMetrics collected(options);
  for (std::int64_t i = 0; i < options.total(); ++i) {
    const TrajectoryPart part = existing_part(parts, i);
    if (i < options.simulated()) {
      const TrajectorySetup setup = draw_setup(options, i, part.attempt);
      writer.append(setup.record, part.samples);
      collected.add(setup, part);
    } else {
      const RandomRow row = random_row(options, i);
      writer.append(random_record(row, draw_setup(options, row.base, part.attempt).record),
                    part.samples);
      collected.add(row.kind, part);
    }
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
