#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ops/kernels/rollout.hpp"
#include "uniphy/data/generate_options.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// Everything that a trajectory of a data set starts from; another law may be put in its place.
struct TrajectorySetup {
  TrajectoryRecord record;
  kernels::LawDescription law;
  std::string motion;  ///< one of GenerateOptions::motions
  double size = 0;     ///< largest side of the body at the start, m
  kernels::GridSettings grid;
  std::int64_t steps = 0;
  kernels::ParticleState<double> initial;
  std::vector<double> mass, volume;  ///< [P] kg, m³
};

/// Draws trajectory `trajectory` (0 … options.total() − 1). `attempt` counts the replacements of
/// runs that failed: the first half of the attempts stay in the part of the parameter ranges that
/// belongs to the trajectory, the others draw from the whole ranges. Always the same for the same
/// arguments.
TrajectorySetup draw_setup(const GenerateOptions& options, std::int64_t trajectory,
                           std::int64_t attempt);

/// The largest step (s) that is stable with room to spare: half a cell per pressure wave, and the
/// explicit limit of viscosity, ρ Δx²/(8μ) (newtonian).
double stable_time_step(const kernels::LawDescription& law, double density, double dx);

}  // namespace uniphy
