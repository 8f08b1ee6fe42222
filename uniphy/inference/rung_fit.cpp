#include "uniphy/inference/rung_fit.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "ops/base/torch.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// Adds the seconds of its life to the task.
class Stopwatch {
 public:
  explicit Stopwatch(RungTask& task) : task_(task), seconds_(task.seconds) {}
  void look() {
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start_;
    task_.seconds = seconds_ + time.count();
  }

 private:
  RungTask& task_;
  double seconds_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Share of the loss that an iteration has to take away.
constexpr double kLittleGain = 0.01;
/// A gain that noise tells from none, in residuals of the mean size: a fit that stops a few of them
/// short has missed a good part of an interval.
constexpr double kGainOverNoise = 1;

}  // namespace

LeastSquaresEnd least_squares(const FitProblem& problem, const Tensor& start, const Pull& pull,
                              std::ptrdiff_t frames, int iterations, const StartsAt& starts,
                              double least_gain, RungTask& task, const AfterStep& after_step) {
  std::optional<StartCorrection> correction;
  Renew renew;
  if (starts) renew = [&](const Tensor& point) { correction = starts(point); };
  return least_squares(
      [&](const Tensor& u) {
        return problem.residuals(u, frames, correction ? &*correction : nullptr);
      },
      renew, problem.seen(frames), start, pull, iterations, least_gain, task, after_step);
}

LeastSquaresEnd least_squares(const Residuals& residuals, const Renew& renew, double seen,
                              const Tensor& start, const Pull& pull, int iterations,
                              double least_gain, RungTask& task, const AfterStep& after_step) {
  const Tensor leaf = start.detach().clone();
  LevenbergMarquardt optimizer({leaf}, LevenbergMarquardtOptions());
  if (task.steps > 0) optimizer.resume(task.optimizer);
  const auto pulled = [&](const Tensor& u) {
    const Tensor r = residuals(u);
    return r.defined() ? torch::cat({r, pull.weight * (u - pull.to)}) : r;
  };
  Stopwatch watch(task);
  const double little = std::max(least_gain, renew ? kGainOverNoise / seen : kLittleGain);
  while (!task.done) {
    if (renew) {
      renew(optimizer.point());
      optimizer.forget_residuals();
    }
    const double loss = optimizer.step(pulled).item<double>();
    ++task.steps;
    const double gained = optimizer.gained();
    task.done =
        optimizer.stuck() || task.steps >= iterations || !(gained > little * (loss + gained));
    task.roll_outs = optimizer.evaluations();
    task.optimizer = optimizer.saved();
    watch.look();
    after_step(task, loss);
  }
  return {optimizer.point(), optimizer.loss()};
}

Tensor descend(const FitProblem& problem, const Tensor& start, const DescentOptions& options,
               RungTask& task, const AfterStep& after_step) {
  Descent descent(options, {start.detach().clone().requires_grad_()});
  if (task.steps > 0) descent.load(task.optimizer);
  Stopwatch watch(task);
  while (!task.done) {
    descent.step([&] { return problem.evaluate(descent.leaves(), 0).loss; });
    ++task.steps;
    task.done = descent.done();
    task.roll_outs = descent.evaluations();
    task.optimizer = descent.save();
    watch.look();
    after_step(task, descent.best_loss());
  }
  return descent.best()[0];
}

}  // namespace uniphy
