#pragma once

#include <cstdint>
#include <string>

#include "uniphy/data/generate_options.hpp"
#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/io/observation.hpp"
#include "uniphy/io/trajectory.hpp"

namespace uniphy {

/// How the objects to identify are drawn.
struct HiddenCaseOptions {
  GenerateOptions draw;           ///< split heldout_all: shapes and draws apart from training's
  std::int64_t frame_stride = 5;  ///< steps from one observed frame to the next
};

/// An object of undisclosed material in two scenes: it is observed in the first, and its behaviour
/// in the second, of another shape and another velocity, is to be predicted.
struct HiddenCase {
  TrajectorySetup observed, other;
  Trajectory observed_truth, other_truth;
};

/// Draws the case of one of options.draw.materials by its number. Parameters come from the whole
/// ranges, but for those (the stiffest sands) that the scene's fixed time step is too long for;
/// draws where a simulation fails or no wall is met in the first half are replaced. Always the same
/// for the same arguments. Throws Error when attempts are used up.
/// `fields` are those of other_truth.
HiddenCase draw_hidden_case(const HiddenCaseOptions& options, std::int64_t material,
                            FrameFields fields = {});

/// All that there is to see of the first scene.
Observation observation_of(const HiddenCase& hidden);

}  // namespace uniphy
