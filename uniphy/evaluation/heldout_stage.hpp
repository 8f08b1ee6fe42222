#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// Declares the keys of `kind: heldout` of uniphy_evaluate and returns its work.
///
/// Draws heldout_materials and heldout_all from the seed, as uniphy_generate does, fits z alone to
/// the samples of every trajectory, and compares law and roll-outs with the analytic ones.
/// Metrics, M a material, medians over the trajectories of heldout_all with the worst beside them:
///   stress_error.M, projection_error.M    law errors (uniphy/training/law_error.hpp); the latter
///   unprojected_error.M                   over trajectories that project, and over the others
///   rollout_error.M                       √position_mse / object size (rollout_error.hpp)
///   stress_error.M.worst, ...
///   heldout_materials.stress_error.M, ... the same over heldout_materials
///   rollouts_failed                       of both sets; heldout_materials.rollouts_failed of one
///   frame_indifference                    the larger of frame_indifference.stress and .projection,
///                                         over the states of both sets (law_checks.hpp)
///   rest_drift                            m, over all fitted and all training codes
///   codes_at_rest, draw_s, fit_s, rollout_s, checks_s
/// A failed roll-out counts as an infinite error: null in metrics.json where it is the worst.
RunFunction heldout_stage(Section& config);

}  // namespace uniphy
