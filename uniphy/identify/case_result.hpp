#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "uniphy/io/trajectory.hpp"

namespace uniphy {

/// What came out for one material.
struct Identified {
  std::string material, shape, other_shape;
  double fit_mse = 0, fit_share = 0;      ///< m², and its root over the largest side
  double other_best = 0;                  ///< m², best of the codes of others that were rolled out
  double resim_mse = 0, resim_share = 0;  ///< NaN where the re-simulation failed
  bool beats_other = false;
  std::string nearest;  ///< material of the nearest training code
  std::size_t roll_outs = 0;
  std::size_t roll_outs_to_a_hundredth = 0;  ///< see infer_run.hpp; 0 where that was not reached
  double wall_s = 0, memory_mb = 0;
};

/// What the pictures show of it.
struct CasePictures {
  std::string material;
  Trajectory observed, fitted, predicted, truth;
  std::vector<double> best;  ///< over the roll-outs of the result's candidate, m²
};

struct CaseResult {
  Identified row;
  CasePictures pictures;
};

/// The mark of a finished case, case.h5 in its folder: the row and the losses; an interrupted run
/// resumes from it and the files that stand beside it. Written last, under another name
/// first.
void write_case_result(const std::filesystem::path& folder, const CaseResult& result,
                       const std::string& fingerprint);

/// The case as a run of the same fingerprint (configuration and model) has finished it; nothing
/// where no such run has. Throws Error where a file of it is damaged.
std::optional<CaseResult> read_case_result(const std::filesystem::path& folder,
                                           const std::string& fingerprint);

/// A finished run is not resumed.
void forget_case_result(const std::filesystem::path& folder);

}  // namespace uniphy
