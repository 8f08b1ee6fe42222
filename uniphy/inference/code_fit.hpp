#pragma once

#include <torch/types.h>

#include <cstddef>
#include <string>
#include <vector>

#include "uniphy/inference/adaptation.hpp"
#include "uniphy/inference/rung_fitter.hpp"

namespace uniphy {

/// What z is fitted to, and how.
struct CodeProblem {
  const Observation& seen;  ///< the observation, or its first part
  const std::string& name;
  const FitVariables& variables;
  const FitOptions& options;
  const AdaptationOptions& adaptation;
  const FitHooks& hooks;
  bool fits_starts;   ///< FitProblem::fits_starts
  double enough;      ///< over size, of a motion that asks for no more
  double least_pull;  ///< uniphy::least_pull of what is seen
};

/// z with the initial state, which is left in the fitter.
struct CodeEnd {
  FitResult fit;  ///< of the schedule; its start is the one that the end comes from
  torch::Tensor point;
  Observation seen;        ///< with the starts of its points where the law has them
  bool explained = false;  ///< to `enough`
};

/// z by the schedule, as in fit_observation, then by least squares with the initial state. Where
/// starts are fitted, the first frame is deformed or clouds are seen, least squares go on from
/// several ends of the schedule (best_end), in rounds between which the starts are moved.
CodeEnd fit_code(RungFitter& fitter, const CodeProblem& problem);

/// Frames of the horizons of a schedule, growing.
std::vector<std::ptrdiff_t> growing_horizons(const FitOptions& options, std::ptrdiff_t contact,
                                             std::ptrdiff_t frames);

}  // namespace uniphy
