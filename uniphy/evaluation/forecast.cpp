#include "uniphy/evaluation/forecast.hpp"

#include <cmath>

namespace uniphy {
Forecast forecast(const Observation& seen, const std::string& name, const FitVariables& variables,
                  const FitOptions& options, const AdaptationOptions& adaptation,
                  const FitHooks& hooks) {
  const Observation half = first_frames(seen, (seen.frames + 1) / 2);
  const Inference result = infer(half, name, variables, options, hooks, adaptation);
  Forecast f;
  f.fit = std::sqrt(result.fit_mse) / result.size;
  f.rung = static_cast<int>(result.rung);
  f.explained = result.explained;
  if (result.fit.determined) f.nearest = variables.nearest(result.fit.u, 1).front().code;
  f.roll_outs = static_cast<double>(result.fit.history.size());
  if (!result.rungs.empty()) f.roll_outs = 0;
  for (const RungReport& r : result.rungs) f.roll_outs += r.roll_outs;

  const ObservedSteps steps = observed_steps(seen, name);
  const kernels::GridSettings grid = observed_grid(seen, name);
  const auto objective = make_motion_objective(seen, steps, grid, options.dtype);
  const std::vector<double> mse =
      objective->frame_mse(result.fit.law, result.fit.motion, seen.frames);
  double sum = 0;
  for (std::int64_t frame = half.frames; frame < seen.frames; ++frame)
    sum += mse[static_cast<std::size_t>(frame)];
  f.forecast = std::sqrt(sum / static_cast<double>(seen.frames - half.frames)) / result.size;
  return f;
}

}  // namespace uniphy
