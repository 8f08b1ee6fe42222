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
  double noise_share = 0;             ///< of a coordinate, over the largest side
  double fit_mse = 0, fit_share = 0;  ///< m², of what was observed, and its root over that side
  double found_mse = 0, found_share = 0;  ///< the same of all particles, against where they were
  double other_best = 0;                  ///< m², best of the codes of others that were rolled out
  double resim_mse = 0, resim_share = 0;  ///< NaN where the re-simulation failed
  bool beats_other = false;
  std::string named;       ///< what the fitted law behaves like, or "not determined"
  std::string numbers;     ///< of that, with 90 % intervals
  std::string truth;       ///< the parameters of the hidden law
  double probability = 0;  ///< of the name
  bool named_right = false;
  std::size_t roll_outs = 0;  ///< of all that was tried
  double wall_s = 0, memory_mb = 0;
};

/// What the pictures show of it.
struct CasePictures {
  std::string material;
  Trajectory observed;          ///< the points that were seen
  Trajectory fitted, whole;     ///< all particles of the first scene: as fitted, as they were
  Trajectory predicted, truth;  ///< of the other scene
  std::vector<double> best;     ///< over the roll-outs of the result's candidate, m²
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
