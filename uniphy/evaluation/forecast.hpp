#pragma once

#include <string>

#include "uniphy/inference/infer_run.hpp"

namespace uniphy {

/// What a law that was fitted to the first half of an observation is worth.
struct Forecast {
  /// Root of the mean squared error of positions over the object's largest side: of the first half
  /// of the frames, and of the second half; infinite where the roll-out fails.
  double fit = 0, forecast = 0;
  int rung = 0;           ///< how far the law was adapted: 0 z alone
  bool explained = true;  ///< Inference::explained
  int nearest = -1;       ///< the start nearest to the fitted point; −1: nothing was determined
  double roll_outs = 0;   ///< of all rungs
};

/// Fits the variables to the first half of the frames, as uniphy_infer does, and rolls the result
/// out over all of them. Throws Error where the fit fails.
Forecast forecast(const Observation& seen, const std::string& name, const FitVariables& variables,
                  const FitOptions& options, const AdaptationOptions& adaptation,
                  const FitHooks& hooks);

}  // namespace uniphy
