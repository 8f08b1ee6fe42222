#pragma once

#include <string>

#include "tests/support/on_threads.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/data/generate_options.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/experiment.hpp"

namespace uniphy::testing {

/// Sets that take a fraction of a second: bodies that start at a wall and are hit at once.
inline constexpr const char* kSmallSets =
    "simulation: {steps: 60, particles: 40}\n"
    "motion: {gap: [0, 0], speed: [3, 5]}\n"
    "samples: {per_trajectory: 60}\n"
    "fit: {starts: 2, steps: 5}\n";

/// The options of a small set.
inline GenerateOptions small_set(const std::string& more = "") {
  const Config config = Config::parse(
      "trajectories: 1\nsimulation: {steps: 60, particles: 40}\nmotion: {gap: [0, 0], speed: [3, "
      "5]}\n"
      "samples: {per_trajectory: 60}\n" +
      more);
  Section root = config.root();
  return read_generate_options(root);
}

/// What a binary does with a configuration, without its command line.
inline Metrics run_stage(const DeclareFunction& declare, const std::string& yaml,
                         const std::filesystem::path& directory, int threads = 2) {
  const Config config = Config::parse(yaml, "config.yaml");
  Section root = config.root();
  const RunFunction work = declare(root);
  config.finish();
  make_directory(directory);
  return on_threads(threads, [&] {
    RunDirectory out(directory, config.resolved(), threads);
    Metrics metrics;
    work(out, metrics);
    return metrics;
  });
}

}  // namespace uniphy::testing
