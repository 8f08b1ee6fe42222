#pragma once

#include <torch/types.h>

#include <functional>

#include "uniphy/inference/adaptation_state.hpp"
#include "uniphy/inference/descent.hpp"
#include "uniphy/inference/fit_problem.hpp"
#include "uniphy/inference/levenberg_marquardt.hpp"
#include "uniphy/inference/start_correction.hpp"

namespace uniphy {

/// Is called after every step of a task with the lowest loss so far.
using AfterStep = std::function<void(const RungTask& task, double loss)>;

/// What draws at the variables of least squares: a number that is off by 1 from `to` counts as much
/// as positions whose root mean square error is `weight` of the size. Both [variables], float64.
struct Pull {
  torch::Tensor to, weight;
};

/// The point of a problem's first `frames` that at most `iterations` of LevenbergMarquardt lead to
/// from `start` (see FitProblem::residuals, also for `starts`); it ends sooner where an iteration
/// gains less than 1 % of the loss, or, with `starts`, where noise is most of that, than ten
/// residuals of the mean size. Goes on where the task was left.
torch::Tensor least_squares(const FitProblem& problem, const torch::Tensor& start, const Pull& pull,
                            std::ptrdiff_t frames, int iterations, const StartCorrection* starts,
                            RungTask& task, const AfterStep& after_step);

/// The lowest point of a Descent over all frames from `start`. Goes on where the task was left.
torch::Tensor descend(const FitProblem& problem, const torch::Tensor& start,
                      const DescentOptions& options, RungTask& task, const AfterStep& after_step);

}  // namespace uniphy
