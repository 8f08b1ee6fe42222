#pragma once

#include "uniphy/data/generate_options.hpp"
#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// Runs the trajectory with its analytic law and returns what the law saw of all particles every
/// `every` steps. Throws Error where the run fails: a particle leaves the grid, or a number is not
/// finite or beyond what any of the materials bears (‖F‖ > 1e3).
LawSamples simulate_candidates(const TrajectorySetup& setup, std::int64_t every);

/// The samples of one trajectory of a data set: candidates of the simulation, selected
/// (select_samples.hpp), then drawn states (drawn_states.hpp) for what the simulation did not
/// reach. A quarter of the drawn states goes to all reachable branches alike, the rest to those
/// with the fewest samples. Always the same for the same arguments, whatever the threads.
LawSamples trajectory_samples(const GenerateOptions& options, const TrajectorySetup& setup,
                              std::uint64_t seed);

}  // namespace uniphy
