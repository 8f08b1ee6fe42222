#pragma once

// observation.h5: what inference may see, and nothing about the material.
//
//   attributes  format = "uniphy-observation", version = 1
//   /x      [frames, particles, 3]  m   observed positions
//   /time   [frames]                s   from the first frame, which is 0
//   /volume [particles]             m^3 volume of each particle at rest
//   /scene  attributes: grid (nodes a side), dt (s), gravity [3] (m/s^2),
//           walls ("freeslip" or "noslip"), bound (wall thickness in nodes), density (kg/m^3)

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy {

struct Observation {
  std::int64_t frames = 0;
  std::int64_t particles = 0;
  std::vector<double> x;       ///< [frames, particles, 3] m
  std::vector<double> time;    ///< [frames] s, increasing
  std::vector<double> volume;  ///< [particles] m^3

  int grid = 20;
  double dt = 0;  ///< s, of the simulation that explains the observation
  std::array<double, 3> gravity{0, -9.8, 0};
  std::string walls = "freeslip";
  int bound = 3;
  double density = 1000;  ///< kg/m^3

  const double* positions(std::int64_t frame) const { return x.data() + frame * particles * 3; }
};

/// What is known of a scene of one body besides its motion, without any frame; grid.dt is the time
/// step.
Observation begin_observation(const kernels::GridSettings& grid, double density,
                              const std::vector<double>& volume);
/// Adds the positions x [particles, 3] at `time`.
void add_frame(Observation& observation, double time, const std::vector<double>& x);

void write_observation(const std::filesystem::path& file, const Observation& observation);
/// Throws Error for anything that is missing, of the wrong shape, not finite, or out of range.
Observation read_observation(const std::filesystem::path& file);

}  // namespace uniphy
