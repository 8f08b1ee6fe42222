#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// Declares the keys of uniphy_ablate and returns its work: every variant is trained with the same
/// budget on data of the same seed, fitted to heldout_all and rolled out, one after another, each
/// on all threads. Finished variants are kept in DIR/NAME and not made again; an interrupted
/// training goes on. With `budget: {type: steps}` all but the times are the same bits on every
/// machine of the same instruction set; with seconds the number of steps is that machine's, and is
/// kept too.
///
/// Metrics: for each variant NAME.parameters, .steps, .train_s, .law_ns (law_cost.hpp),
/// .stress_error, .projection_error, .rollout_error (medians over all held-out trajectories, of the
/// projection over those that project), the same and .unprojected_error with .M of each material M
/// and .M.worst, and .rollouts_failed.
RunFunction ablation_stage(Section& config);

}  // namespace uniphy
