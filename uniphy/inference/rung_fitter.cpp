#include "uniphy/inference/rung_fitter.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/misfit.hpp"
#include "uniphy/inference/observed_motion.hpp"
#include "uniphy/report/progress.hpp"

namespace uniphy {

using torch::Tensor;

namespace {
/// Beyond this a pull holds a number as well as any larger one, and rounding spoils the equations.
constexpr double kMostPull = 1e3;
/// Over size: what no polynomial start tells of a motion. Numbers that the motion does not show (of
/// a fluid, all of a stretch but its volume) are kept where they are by it.
constexpr double kPolynomialError = 1e-4;
}  // namespace

RungFitter::RungFitter(const Observation& observation, const std::string& name,
                       const FitVariables& latent, const FitOptions& options,
                       const AdaptationOptions& adaptation, const FitHooks& hooks)
    : observation_(observation),
      name_(name),
      latent_(latent),
      options_(options),
      adaptation_(adaptation),
      hooks_(hooks),
      state_(adaptation_state_file(hooks.state_file), hooks),
      size_(observed_size(observation)),
      first_motion_(estimate_motion(observation, observed_steps(observation, name),
                                    observed_grid(observation, name))),
      motion_(first_motion_.motion) {
  if (!can_be_adapted(latent)) return;
  for (const Rung rung : {Rung::latent, Rung::numbers, Rung::weights}) {
    adapted_.push_back(std::make_unique<AdaptedVariables>(latent, rung));
  }
}

/// Differences of roll-outs want float64.
FitOptions RungFitter::rung_options(bool differences) const {
  FitOptions o = options_;
  if (differences) o.dtype = "float64";
  o.rollout = "fused";
  o.detail = detail_;
  o.pull = adaptation_.pull;
  o.stages = {FitStage()};
  return o;
}

const FitVariables& RungFitter::of(Rung rung) const {
  return rung == Rung::latent ? latent_ : variables(rung);
}

RungReport& RungFitter::report(Rung rung) {
  for (RungReport& r : reports_) {
    if (r.rung == rung) return r;
  }
  reports_.emplace_back().rung = rung;
  return reports_.back();
}

template <class Improve>
auto RungFitter::work(Rung rung, const std::string& name, int steps, const Improve& improve) {
  RungTask& task = state_.task(fmt::format("{} {}", rung_name(rung), name));
  std::optional<Progress> progress;
  if (hooks_.progress && !task.done) progress.emplace(task.name, steps, "roll-outs");
  const auto result = improve(task, [&](const RungTask& at, double loss) {
    if (hooks_.on_record) {
      const int stage = static_cast<int>(options_.stages.size()) + static_cast<int>(rung);
      hooks_.on_record(
          {stage, 0, at.steps, std::numeric_limits<double>::infinity(), loss * size_ * size_});
    }
    state_.checkpoint(at.done);
    if (progress) {
      progress->update(at.roll_outs, fmt::format("root/size {:.2e}", std::sqrt(loss)));
    }
  });
  report(rung).roll_outs += task.roll_outs;
  report(rung).seconds += task.seconds;
  return result;
}

LeastSquaresEnd RungFitter::least_squares(const Observation& seen, std::ptrdiff_t frames, Rung rung,
                                          const Tensor& start, const Tensor& to, double pull,
                                          const std::string& task, int iterations,
                                          FitVelocity velocity, double least_gain) {
  const bool with_motion = velocity != FitVelocity::no;
  const FitOptions options = rung_options(true);
  const FitVariables& variables = of(rung);
  const FitProblem problem(seen, name_, variables, options, &motion_);
  const Tensor still = torch::zeros({with_motion ? problem.motion_size() : 0}, torch::kFloat64);
  const Tensor from = torch::cat({start, still});
  Pull all{to, torch::full_like(to, pull)};
  if (with_motion) {
    all.to = torch::cat({to, problem.change_to(first_motion_.motion)});
    const Tensor weight = pull_of_motion(problem, from, frames, velocity == FitVelocity::held);
    all.weight = torch::cat({all.weight, weight});
  }
  const int columns = static_cast<int>(from.numel());
  const int roll_outs = iterations * (columns + LevenbergMarquardt::kTrialEvaluations);
  StartsAt renewed;
  if (problem.fits_starts()) {
    renewed = [&](const Tensor& point) { return starts_at(problem, point, frames); };
  }
  LeastSquaresEnd end = work(rung, task, roll_outs, [&](RungTask& t, const AfterStep& after) {
    return uniphy::least_squares(problem, from, all, frames, iterations, renewed, least_gain, t,
                                 after);
  });
  if (with_motion) motion_ = problem.motion_at(end.point);
  end.point = end.point.slice(0, 0, variables.size()).clone();
  return end;
}

std::optional<StartCorrection> RungFitter::starts_at(const FitProblem& problem, const Tensor& point,
                                                     std::ptrdiff_t frames) const {
  if (!problem.fits_starts()) return {};
  try {
    return problem.start_correction(point, frames);
  } catch (const Error&) {
    return {};
  }
}

FitPosterior RungFitter::posterior(const Observation& seen, Rung rung, const Tensor& point) {
  const FitOptions options = rung_options(true);
  const FitVariables& variables = of(rung);
  const FitProblem problem(seen, name_, variables, options, &motion_);
  const Tensor at = torch::cat({point, torch::zeros({problem.motion_size()}, torch::kFloat64)});
  const std::optional<StartCorrection> starts = starts_at(problem, at, seen.frames);
  std::vector<std::int64_t> columns;
  if (can_be_adapted(latent_)) {
    columns = this->variables(rung).leading();
  } else {
    for (int k = 0; k < variables.size(); ++k) columns.push_back(k);
  }
  for (int k = 0; k < problem.motion_size(); ++k) columns.push_back(point.numel() + k);
  const auto begin = std::chrono::steady_clock::now();
  std::optional<Progress> progress;
  PosteriorOptions how;
  how.samples = adaptation_.samples;
  how.noise = problem.noise_over_size();
  if (hooks_.progress) {
    progress.emplace("posterior", 0, "samples");
    how.progress = [&](int done) { progress->update(done); };
  }
  FitPosterior result = fit_posterior(
      [&](const Tensor& u) {
        return problem.residuals(u, seen.frames, starts ? &*starts : nullptr);
      },
      at, columns, problem.motion_size(), problem.seen(seen.frames), how);
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
  report(rung).roll_outs += result.evaluations;
  report(rung).seconds += time.count();
  return result;
}

Tensor RungFitter::pull_of_motion(const FitProblem& problem, const Tensor& point,
                                  std::ptrdiff_t frames, bool held) const {
  double beside = 0;
  if (held) {
    const std::optional<StartCorrection> starts = starts_at(problem, point, frames);
    const Tensor r = problem.residuals(point, frames, starts ? &*starts : nullptr);
    beside = misfit_beside_noise(problem, r.defined() ? r.square().sum().item<double>() : 0,
                                 starts.has_value());
  }
  return motion_pull(problem, first_motion_, frames, beside);
}

double misfit_beside_noise(const FitProblem& problem, double loss, bool starts) {
  const double allowed = (starts ? kNoiseAllowance : 2) * problem.noise_over_size();
  return std::max(0.0, loss - allowed * allowed);
}

Tensor motion_pull(const FitProblem& problem, const MotionEstimate& first, std::ptrdiff_t frames,
                   double beside) {
  const double noise = problem.noise_over_size();
  if (problem.motion_size() > initial_numbers(0))
    beside = std::max(beside, kPolynomialError * kPolynomialError);
  const double error = std::sqrt(noise * noise / problem.seen(frames) + beside);
  const Tensor spread = torch::tensor(first.spread, torch::kFloat64);
  return (error * problem.motion_units() / spread).clamp_max(kMostPull);
}

Tensor RungFitter::start_shift(const Observation& seen, Rung rung, const Tensor& point) const {
  const FitOptions options = rung_options(true);
  const FitProblem problem(seen, name_, of(rung), options, &motion_);
  return problem.start_correction(point, seen.frames)
      .correction(problem.misses(point, seen.frames));
}

Tensor RungFitter::descend(const Observation& seen, const Tensor& start, const std::string& task,
                           int epochs) {
  const FitOptions options = rung_options(false);
  const FitProblem problem(seen, name_, variables(Rung::weights), options, &motion_);
  const DescentOptions descent{adaptation_.optimizer, adaptation_.rate, epochs, options_.clip,
                               epochs};
  return work(Rung::weights, task, epochs, [&](RungTask& t, const AfterStep& after) {
    return uniphy::descend(problem, start, descent, t, after);
  });
}

std::vector<double> RungFitter::roots(const Tensor& point, Rung rung, std::ptrdiff_t frames) const {
  const FitOptions options = rung_options(true);
  const FitProblem whole(observation_, name_, of(rung), options, &motion_);
  FitCandidate candidate = whole.candidate(0);
  candidate.u = point;
  std::vector<double> root = whole.frame_mse(candidate, frames);
  for (double& r : root) r = std::sqrt(r) / size_;
  return root;
}

bool RungFitter::lasts(const Tensor& point, Rung rung) const {
  Observation longer = first_frames(observation_, 2);
  longer.time[1] = longer.time[0] + 2 * (observation_.time.back() - observation_.time[0]);
  // What is compared does not matter; nothing is hidden, so that every frame counts.
  const std::vector<double> points = longer.tracked() ? longer.tracers : longer.start();
  longer.x = points;
  longer.x.insert(longer.x.end(), points.begin(), points.end());
  const FitOptions options = rung_options(true);
  const FitProblem problem(longer, name_, of(rung), options, &motion_);
  FitCandidate candidate = problem.candidate(0);
  candidate.u = point;
  return std::isfinite(problem.frame_mse(candidate, 2)[1]);
}

}  // namespace uniphy
