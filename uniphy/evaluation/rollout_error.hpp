#pragma once

#include <memory>
#include <string>
#include <vector>

#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/io/dataset.hpp"
#include "uniphy/io/trajectory.hpp"

namespace uniphy {

/// How far a roll-out with a learned law is from the analytic one.
struct RolloutError {
  double root_over_size =
      0;                ///< √position_mse / largest side of the body; infinite where it failed
  std::string failure;  ///< why the learned roll-out did not finish, or empty
};

/// Each trajectory's own scene (shape, motion, dt, all steps, a frame every 5th) with its analytic
/// law and once more with `laws[i]`, in float64, one trajectory a thread; the same bits on any
/// number of threads. A learned roll-out that throws (a particle leaves the grid, a position is no
/// longer finite) is a failure; an analytic one that throws is an Error.
std::vector<RolloutError> rollout_errors(const std::vector<TrajectorySetup>& setups,
                                         const std::vector<kernels::LawDescription>& laws);

/// The scene of one trajectory with its own law, or with another. Throws Error where it fails.
Trajectory roll_out(const TrajectorySetup& setup, const kernels::LawDescription& law);

/// setup_of() for all trajectories of a data set of uniphy_generate.
std::vector<TrajectorySetup> setups_of(const Dataset& data);

/// The learned law with each of the codes; latents: [codes, latent_size] row-major.
std::vector<kernels::LawDescription> learned_laws(
    const std::shared_ptr<const kernels::LearnedLawWeights>& weights,
    const std::vector<double>& latents);

}  // namespace uniphy
