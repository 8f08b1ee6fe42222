#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/identify/case_result.hpp"
#include "uniphy/identify/hidden_case.hpp"
#include "uniphy/inference/infer_run.hpp"
#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// The main job: identify objects of undisclosed material and predict them elsewhere.
struct IdentifyOptions {
  HiddenCaseOptions hidden;
  FitVariablesSource variables;
  FitOptions fit;
};

/// Declares and reads all keys.
IdentifyOptions read_identify_options(Section& config);

/// Does all materials, prints and writes the table, the pictures and the metrics fit_mse.M,
/// resim_mse.M, fit_beats_other.M, fit_root_over_size.M, resim_root_over_size.M, other_best_mse.M,
/// roll_outs.M, roll_outs_to_a_hundredth.M (0: not reached), seconds.M, memory_mb.M. An interrupted
/// run goes on with the materials that it has finished. Throws Error at the end where a number is
/// not finite.
void identify(const IdentifyOptions& options, RunDirectory& out, Metrics& metrics);

/// The table in Markdown.
std::string identify_table(const std::vector<Identified>& rows);

}  // namespace uniphy
