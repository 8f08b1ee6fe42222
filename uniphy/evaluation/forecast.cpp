#include "uniphy/evaluation/forecast.hpp"

#include <cmath>
#include <cstdio>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/start_correction.hpp"

namespace uniphy {
namespace {

std::int64_t fitted_frames(const Observation& seen) { return (seen.frames + 1) / 2; }

/// What the second half is compared with, of points that start as in `from`.
Observation judged(const JudgedMotion& motion, const Observation& from) {
  Observation all =
      motion.truth.empty() ? with_known_starts(motion.seen, motion.name) : motion.seen;
  all.body = from.body;
  all.tracers = from.tracers;
  if (motion.truth.empty()) return all;
  all.tracers.clear();
  all.cloud = 0;
  all.x = motion.truth;
  return all;
}

}  // namespace

Forecast forecast(const JudgedMotion& motion, const FitVariables& variables,
                  const FitOptions& options, const AdaptationOptions& adaptation,
                  const FitHooks& hooks) {
  const Observation known = with_known_starts(motion.seen, motion.name);
  const Observation half = first_frames(known, fitted_frames(known));
  const Inference result = infer(half, motion.name, variables, options, hooks, adaptation);
  Forecast f;
  f.fit = std::sqrt(result.fit_mse) / result.size;
  f.rung = static_cast<int>(result.rung);
  f.explained = result.explained;
  if (result.fit.determined) f.nearest = variables.nearest(result.fit.u, 1).front().code;
  f.material = result.material.reading.material;
  f.roll_outs = result.roll_outs;
  f.forecast =
      forecast_error(motion, result.seen, result.fit.law, result.fit.motion, options.dtype, {});
  return f;
}

Forecast forecast_or_failure(const JudgedMotion& motion, const std::string& by,
                             const FitVariables& variables, const FitOptions& options,
                             const AdaptationOptions& adaptation, const FitHooks& hooks) {
  try {
    return forecast(motion, variables, options, adaptation, hooks);
  } catch (const Error& error) {
    std::fprintf(stderr, "warning: %s fitted by %s: %s\n", motion.name.c_str(), by.c_str(),
                 error.what());
    Forecast failed;
    failed.fit = failed.forecast = std::numeric_limits<double>::infinity();
    failed.explained = false;
    return failed;
  }
}

double forecast_error(const JudgedMotion& motion, const kernels::LawDescription& law,
                      const InitialState& initial, const std::string& dtype) {
  return forecast_error(motion, motion.seen, law, initial, dtype, {});
}

double forecast_error(const JudgedMotion& motion, const Observation& from,
                      const kernels::LawDescription& law, const InitialState& initial,
                      const std::string& dtype, const std::vector<Companion>& companions) {
  const Observation all = judged(motion, from);
  const ObservedSteps steps = observed_steps(all, motion.name);
  const kernels::GridSettings grid = observed_grid(all, motion.name);
  const auto objective =
      make_motion_objective(all, steps, grid, dtype, "fused", CloudDetail::all, companions);
  const std::vector<double> mse = objective->frame_mse(law, initial, all.frames);
  const std::int64_t first = fitted_frames(all);
  double sum = 0;
  for (std::int64_t f = first; f < all.frames; ++f) sum += mse[static_cast<std::size_t>(f)];
  return std::sqrt(sum / static_cast<double>(all.frames - first)) / observed_size(motion.seen);
}

}  // namespace uniphy
