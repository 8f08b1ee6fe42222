#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/data/laboratory_view.hpp"
#include "uniphy/identify/case_result.hpp"
#include "uniphy/identify/hidden_case.hpp"
#include "uniphy/inference/infer_run.hpp"
#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// The main job: identify objects of undisclosed material and predict them elsewhere.
struct IdentifyOptions {
  HiddenCaseOptions hidden;
  LaboratoryView view;  ///< what inference sees of the first scene
  FitVariablesSource variables;
  FitOptions fit;
  AdaptationOptions adaptation;
};

/// Declares and reads all keys.
IdentifyOptions read_identify_options(Section& config);

/// Does all materials, prints and writes the table, the pictures and the metrics fit_mse.M (of what
/// was observed), found_mse.M (of all particles against where they were), resim_mse.M,
/// noise_over_size.M, fit_root_over_size.M, found_root_over_size.M, resim_root_over_size.M,
/// fit_beats_other.M, other_best_mse.M, named_right.M (1 or 0), roll_outs.M, seconds.M,
/// memory_mb.M. An interrupted run goes on with the materials that it has finished. Throws Error at
/// the end where a number is not finite.
void identify(const IdentifyOptions& options, RunDirectory& out, Metrics& metrics);

}  // namespace uniphy
