#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/bench/measurer.hpp"
#include "uniphy/config/config.hpp"

namespace uniphy::bench {

/// Steps of an epoch from frame to frame.
inline constexpr std::int64_t kEpochStride = 5;

/// What is measured, and how thoroughly. The defaults are what the goals are about.
struct BenchOptions {
  std::vector<std::string> subjects;
  Effort effort;
  std::int64_t copy_mb = 256;

  std::int64_t svd_matrices = 100000;

  std::vector<std::string> laws;  ///< names of analytic laws
  std::int64_t law_particles = 10000;

  std::vector<std::int64_t> learned_particles;

  std::vector<std::int64_t> mpm_particles;
  std::int64_t mpm_goal_particles = 100000;  ///< where the goals are read and the baseline runs
  std::int64_t mpm_steps = 32;

  std::int64_t epoch_side = 10;  ///< particles a side of the cube
  std::int64_t epoch_steps = 1000;
  std::int64_t epoch_rounds = 2;
  std::int64_t epoch_plain_steps = 4;

  std::int64_t train_trajectories = 200;
  std::int64_t train_batch = 64;

  bool measures(const std::string& subject) const;
};

BenchOptions read_bench_options(Section& config);

}  // namespace uniphy::bench
