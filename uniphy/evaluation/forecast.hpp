#pragma once

#include <string>

#include "uniphy/inference/infer_run.hpp"

namespace uniphy {

/// What a law that was fitted to the first half of an observation is worth.
struct Forecast {
  /// Root of the mean squared error over the object's largest side: of the observed positions of
  /// the first half of the frames, and of the second half; infinite where the roll-out fails.
  double fit = 0, forecast = 0;
  int rung = 0;           ///< how far the law was adapted: 0 z alone
  bool explained = true;  ///< Inference::explained
  int nearest = -1;       ///< the start nearest to the fitted point; −1: nothing was determined
  double roll_outs = 0;   ///< of all rungs
  std::string material;   ///< what the law behaves like (MaterialReading); empty likewise
};

/// What is fitted, and what the forecast is judged by.
struct JudgedMotion {
  Observation seen;
  std::string name;  ///< for messages
  /// Where all particles of the body are at the times of `seen`; empty: the positions in `seen` are
  /// the truth.
  std::vector<double> truth = {};
};

/// Fits the variables to the first half of the frames, as uniphy_infer does, and rolls the result
/// out over all of them. Throws Error where the fit fails.
Forecast forecast(const JudgedMotion& motion, const FitVariables& variables,
                  const FitOptions& options, const AdaptationOptions& adaptation,
                  const FitHooks& hooks);

/// The same; a fit that fails has infinite errors, and a warning says why `by` failed.
Forecast forecast_or_failure(const JudgedMotion& motion, const std::string& by,
                             const FitVariables& variables, const FitOptions& options,
                             const AdaptationOptions& adaptation, const FitHooks& hooks);

/// The error of the second half over the size where that law moves the body, from where it stands,
/// with that initial velocity: of a true law, the floor that the discretisation leaves. Infinite
/// where the roll-out fails.
double forecast_error(const JudgedMotion& motion, const kernels::LawDescription& law,
                      const InitialState& initial, const std::string& dtype);
/// The same of a body whose points start as in `from`, with others in the scene.
double forecast_error(const JudgedMotion& motion, const Observation& from,
                      const kernels::LawDescription& law, const InitialState& initial,
                      const std::string& dtype, const std::vector<Companion>& companions);

}  // namespace uniphy
