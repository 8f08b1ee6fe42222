#pragma once

#include <torch/types.h>

#include <functional>

#include "uniphy/inference/adaptation_state.hpp"
#include "uniphy/inference/descent.hpp"
#include "uniphy/inference/fit_problem.hpp"
#include "uniphy/inference/levenberg_marquardt.hpp"

namespace uniphy {

/// Is called after every step of a task with the lowest loss so far.
using AfterStep = std::function<void(const RungTask& task, double loss)>;

/// The point of a problem's first `frames` that `iterations` of LevenbergMarquardt lead to from
/// `start`, which also draws at it weakly (kWeakPrior). It ends sooner where two iterations gain
/// less than 2 % of the loss each, or nothing is gained. Goes on where the task was left.
torch::Tensor least_squares(const FitProblem& problem, const torch::Tensor& start,
                            std::ptrdiff_t frames, int iterations, RungTask& task,
                            const AfterStep& after_step);

/// The lowest point of a Descent over all frames from `start`. Goes on where the task was left.
torch::Tensor descend(const FitProblem& problem, const torch::Tensor& start,
                      const DescentOptions& options, RungTask& task, const AfterStep& after_step);

/// A number that moves nothing stays near its start: one that is off by 1 counts as much as
/// positions that are off by 1e-5 of the size, less than the arithmetic of a float roll-out.
inline constexpr double kWeakPrior = 1e-10;

}  // namespace uniphy
