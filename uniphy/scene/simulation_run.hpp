#pragma once

#include <cstdint>

#include "uniphy/config/config.hpp"
#include "uniphy/report/experiment.hpp"
#include "uniphy/scene/scene.hpp"

namespace uniphy {

/// What a simulation leaves in its output directory.
struct SimulationOutput {
  FrameFields fields;               ///< stored with every frame besides x
  int gzip = 0;                     ///< 0 … 9
  bool observation = false;         ///< observation.h5 too, for uniphy_infer
  std::int64_t picture_frames = 6;  ///< panels of frames.png, 0: no picture
};

/// Declares and reads the section `output`.
SimulationOutput read_simulation_output(Section& config);

/// Runs the scene and writes trajectory.h5, trajectory.xdmf, frames.png and, where it is asked for,
/// observation.h5 into `out`; frames go to the disk as they come. Metrics: dt, stable_dt (s),
/// steps, frames, simulated_s, particles and, for each body, particles.NAME,
/// particles_per_cell.NAME and volume.NAME (m³), mass (kg), ns_per_particle_step;
/// first_step of a run that goes on from an earlier one (continued_run.hpp).
///
/// A run that fails or is interrupted between two frames leaves the frames that it has: an
/// incomplete trajectory.h5 (trajectory.hpp), trajectory.xdmf and frames.png, in place of those of
/// an earlier run. What ended it is thrown on.
void simulate_into(const SceneDescription& scene, const SimulationOutput& output, RunDirectory& out,
                   Metrics& metrics);

}  // namespace uniphy
