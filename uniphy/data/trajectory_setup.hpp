#pragma once

#include <cstdint>
#include <string>

#include "uniphy/data/generate_options.hpp"
#include "uniphy/io/dataset.hpp"
#include "uniphy/scene/scene.hpp"

namespace uniphy {

/// Everything that a trajectory of a data set starts from. Another law may be put in the place of
/// scene.bodies[0].law to see the same motion with it.
struct TrajectorySetup {
  TrajectoryRecord record;
  std::string motion;      ///< one of GenerateOptions::motions
  SceneDescription scene;  ///< one body; dt and steps are set

  const kernels::LawDescription& law() const { return scene.bodies.front().law; }
};

/// Draws trajectory `trajectory` (0 … options.simulated() − 1). `attempt` counts the replacements
/// of runs that failed: the first half of the attempts stay in the part of the parameter ranges
/// that belongs to the trajectory, the others draw from the whole ranges. Always the same for the
/// same arguments.
TrajectorySetup draw_setup(const GenerateOptions& options, std::int64_t trajectory,
                           std::int64_t attempt);

/// Share of stable_time_step() up to which a fixed step is left as it is.
inline constexpr double kFixedStepSafety = 0.6;

}  // namespace uniphy
