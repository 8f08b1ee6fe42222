#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/identify/hidden_case.hpp"
#include "uniphy/inference/infer_run.hpp"
#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// The main job: identify objects of undisclosed material and foretell them elsewhere.
struct IdentifyOptions {
  HiddenCaseOptions hidden;
  UnknownsSource unknowns;
  FitOptions fit;
};

/// Declares and reads all keys.
IdentifyOptions read_identify_options(Section& config);

/// What came out for one material.
struct Identified {
  std::string material, shape, other_shape;
  double fit_mse = 0, fit_share = 0;      ///< m², and its root over the largest side
  double other_best = 0;                  ///< m², best single code of any other material
  double resim_mse = 0, resim_share = 0;  ///< NaN where the re-simulation failed
  bool beats_other = false;
  std::string nearest;  ///< material of the nearest training code
  std::size_t roll_outs = 0;
  double wall_s = 0, memory_mb = 0;
  std::string failure;  ///< empty where all went well
};

/// Does all materials, prints and writes the table, the pictures and the metrics fit_mse.M,
/// resim_mse.M, fit_beats_other.M, fit_root_over_size.M, resim_root_over_size.M, other_best_mse.M,
/// roll_outs.M, seconds.M, memory_mb.M. Throws Error at the end where a number is not finite.
void identify(const IdentifyOptions& options, RunDirectory& out, Metrics& metrics);

/// The table in Markdown.
std::string identify_table(const std::vector<Identified>& rows);

}  // namespace uniphy
