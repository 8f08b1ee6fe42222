#pragma once

#include <torch/types.h>

#include <functional>
#include <optional>

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

/// Where the points start by the flow at a point of a problem; nothing where the roll-out fails.
using StartsAt = std::function<std::optional<StartCorrection>(const torch::Tensor& point)>;

/// Where least squares ended.
struct LeastSquaresEnd {
  torch::Tensor point;
  double loss = 0;  ///< of it, with the pull
};

/// The point of a problem's first `frames` that at most `iterations` of LevenbergMarquardt lead to
/// from `start` (see FitProblem::residuals). It ends sooner where an iteration gains less than 1 %
/// of the loss. Where `starts` is not empty, those of the points are eliminated by the flow at
/// each iteration's point, and as noise then is most of the loss, it ends where an iteration gains
/// less than a residual of the mean size; either way at once where one gains less than the share
/// `least_gain` of the loss. Goes on where the task was left.
LeastSquaresEnd least_squares(const FitProblem& problem, const torch::Tensor& start,
                              const Pull& pull, std::ptrdiff_t frames, int iterations,
                              const StartsAt& starts, double least_gain, RungTask& task,
                              const AfterStep& after_step);

/// Is called with each iteration's point before residuals are asked for there.
using Renew = std::function<void(const torch::Tensor& point)>;

/// The same of any residuals of about so many coordinates `seen`; where `renew` is not empty they
/// are others after it, and end as with starts.
LeastSquaresEnd least_squares(const Residuals& residuals, const Renew& renew, double seen,
                              const torch::Tensor& start, const Pull& pull, int iterations,
                              double least_gain, RungTask& task, const AfterStep& after_step);

/// The lowest point of a Descent over all frames from `start`. Goes on where the task was left.
torch::Tensor descend(const FitProblem& problem, const torch::Tensor& start,
                      const DescentOptions& options, RungTask& task, const AfterStep& after_step);

}  // namespace uniphy
