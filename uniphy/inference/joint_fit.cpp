#include "uniphy/inference/joint_fit.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/fit_problem.hpp"
#include "uniphy/inference/misfit.hpp"
#include "uniphy/inference/observed_motion.hpp"
#include "uniphy/inference/observed_noise.hpp"
#include "uniphy/inference/rung_fit.hpp"
#include "uniphy/inference/rung_fitter.hpp"
#include "uniphy/report/progress.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// Rounds of least squares between which the starts of noisy points are moved.
constexpr int kStartRounds = 4;
/// Share of the loss that a round has to take away for another.
constexpr double kRoundGain = 1e-3;

}  // namespace

bool JointBody::explained() const { return std::sqrt(loss) <= enough; }

/// The residuals of all bodies at a point: u of each, then the change of the initial state of each.
class JointFit::Problem {
 public:
  Problem(std::vector<JointBody>& bodies, const FitVariables& variables, const FitOptions& options)
      : bodies_(bodies), variables_(variables), options_(options), starts_(bodies.size()) {
    for (const JointBody& b : bodies_) {
      own_.push_back(std::make_unique<FitProblem>(b.seen, b.name, variables_, options_, &b.motion));
      first_.push_back(
          estimate_motion(b.seen, observed_steps(b.seen, b.name), observed_grid(b.seen, b.name)));
    }
  }

  std::int64_t size() const { return variables_.size(); }
  std::int64_t count() const { return static_cast<std::int64_t>(bodies_.size()); }
  const FitProblem& of(std::size_t k) const { return *own_[k]; }
  std::int64_t motion_first(std::size_t k) const {
    std::int64_t at = count() * size();
    for (std::size_t j = 0; j < k; ++j) at += own_[j]->motion_size();
    return at;
  }
  std::int64_t motion_size() const { return motion_first(bodies_.size()) - count() * size(); }

  Tensor start() const {
    std::vector<Tensor> parts;
    for (const JointBody& b : bodies_) parts.push_back(b.u);
    parts.push_back(torch::zeros({motion_size()}, torch::kFloat64));
    return torch::cat(parts);
  }
  Tensor code(const Tensor& point, std::size_t k) const {
    const std::int64_t first = std::int64_t(k) * size();
    return point.slice(0, first, first + size());
  }
  /// u and the change of the initial state of one body.
  Tensor point_of(const Tensor& point, std::size_t k) const {
    const std::int64_t first = motion_first(k);
    return torch::cat({code(point, k), point.slice(0, first, first + own_[k]->motion_size())});
  }

  /// Holds codes to where they begin and initial states to those of the first frames.
  Pull pull(const Tensor& at) const {
    std::vector<Tensor> to, weight;
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      to.push_back(code(at, k));
      weight.push_back(torch::full_like(to.back(), own_[k]->least_pull(own_[k]->frames())));
    }
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      to.push_back(own_[k]->change_to(first_[k].motion));
      const double beside =
          bodies_[k].fits_starts ? 0 : misfit_beside_noise(*own_[k], loss_of(at, k), false);
      weight.push_back(motion_pull(*own_[k], first_[k], own_[k]->frames(), beside));
    }
    return {torch::cat(to), torch::cat(weight)};
  }

  /// Residuals of one body; undefined where the roll-out fails.
  Tensor residuals_of(const Tensor& point, std::size_t k) const {
    const FitOptions options = with_others(point, k);
    const FitProblem problem(bodies_[k].seen, bodies_[k].name, variables_, options,
                             &bodies_[k].motion);
    return problem.residuals(point_of(point, k), problem.frames(),
                             starts_[k] ? &*starts_[k] : nullptr);
  }
  /// Those of all, frame by frame; the sum of their squares is the mean over the bodies.
  Tensor residuals(const Tensor& point) const {
    std::vector<Tensor> frames, prior;
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      const Tensor r = residuals_of(point, k);
      if (!r.defined()) return {};
      const std::int64_t rows = own_[k]->frames(), all = r.numel() - r.numel() % rows;
      frames.push_back(r.slice(0, 0, all).view({rows, -1}));
      prior.push_back(r.slice(0, all, r.numel()));
    }
    prior.insert(prior.begin(), torch::cat(frames, 1).flatten());
    return torch::cat(prior) / std::sqrt(double(bodies_.size()));
  }
  double loss_of(const Tensor& point, std::size_t k) const {
    const Tensor r = residuals_of(point, k);
    return r.defined() ? r.square().sum().item<double>() : std::numeric_limits<double>::infinity();
  }
  double seen() const {
    double all = 0;
    for (const auto& p : own_) all += p->seen(p->frames());
    return all;
  }

  /// Eliminates the starts by the flow at a point.
  void renew(const Tensor& point) {
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      starts_[k].reset();
      if (!bodies_[k].fits_starts) continue;
      const FitOptions options = with_others(point, k);
      const FitProblem problem(bodies_[k].seen, bodies_[k].name, variables_, options,
                               &bodies_[k].motion);
      try {
        starts_[k] = problem.start_correction(point_of(point, k), problem.frames());
      } catch (const Error&) {  // the roll-out fails
      }
    }
  }
  /// The bodies at a point, with their starts where it has them.
  std::vector<JointBody> at(const Tensor& point) {
    renew(point);
    std::vector<JointBody> moved = bodies_;
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      moved[k].u = code(point, k).clone();
      moved[k].motion = own_[k]->motion_at(point_of(point, k));
      moved[k].loss = loss_of(point, k);
      if (!starts_[k]) continue;
      const FitOptions options = with_others(point, k);
      const FitProblem problem(bodies_[k].seen, bodies_[k].name, variables_, options,
                               &bodies_[k].motion);
      moved[k].seen = with_corrected_starts(
          bodies_[k].seen,
          starts_[k]->correction(problem.misses(point_of(point, k), problem.frames())));
    }
    return moved;
  }

 private:
  FitOptions with_others(const Tensor& point, std::size_t k) const {
    FitOptions options = options_;
    options.companions.clear();
    for (std::size_t j = 0; j < bodies_.size(); ++j) {
      if (j == k) continue;
      const Observation& o = bodies_[j].seen;
      options.companions.push_back({o.start(), o.volume, o.density,
                                    variables_.law(code(point, j).contiguous()),
                                    own_[j]->motion_at(point_of(point, j))});
    }
    return options;
  }

  const std::vector<JointBody>& bodies_;
  const FitVariables& variables_;
  const FitOptions& options_;
  std::vector<std::unique_ptr<const FitProblem>> own_;
  std::vector<MotionEstimate> first_;
  std::vector<std::optional<StartCorrection>> starts_;
};

JointFit::JointFit(std::vector<JointBody> bodies, const FitVariables& variables,
                   const FitOptions& options, const AdaptationOptions& adaptation,
                   const FitHooks& hooks)
    : options_(options),
      variables_(variables),
      adaptation_(adaptation),
      hooks_(hooks),
      bodies_(std::move(bodies)),
      state_(adaptation_state_file(hooks.state_file), hooks) {
  options_.dtype = "float64";  // differences want it
  options_.rollout = "fused";
  options_.stages = {FitStage()};
  for (JointBody& b : bodies_) {
    const FitProblem problem(b.seen, b.name, variables_, options_, &b.motion);
    b.fits_starts = problem.fits_starts();
    b.enough = std::hypot(adaptation.enough,
                          (b.fits_starts ? kNoiseAllowance : 2) * problem.noise_over_size());
  }
}

void JointFit::run() {
  const bool starts =
      std::any_of(bodies_.begin(), bodies_.end(), [](const JointBody& b) { return b.fits_starts; });
  double loss = std::numeric_limits<double>::infinity();
  for (int round = 1; round <= (starts ? kStartRounds : 1); ++round) {
    Problem problem(bodies_, variables_, options_);
    const Tensor from = problem.start();
    problem.renew(from);
    const Pull pull = problem.pull(from);
    RungTask& task = state_.task(fmt::format("all bodies, round {}", round));
    std::optional<Progress> progress;
    const int columns = static_cast<int>(from.numel());
    if (hooks_.progress && !task.done) {
      progress.emplace(task.name,
                       adaptation_.iterations * (columns + LevenbergMarquardt::kTrialEvaluations),
                       "roll-outs");
    }
    const LeastSquaresEnd end = least_squares(
        [&](const Tensor& point) { return problem.residuals(point); },
        starts ? Renew([&](const Tensor& point) { problem.renew(point); }) : Renew(),
        problem.seen(), from, pull, adaptation_.iterations, 0, task,
        [&](const RungTask& t, double at) {
          state_.checkpoint(t.done);
          if (progress)
            progress->update(t.roll_outs, fmt::format("root/size {:.2e}", std::sqrt(at)));
        });
    roll_outs_ += task.roll_outs * static_cast<int>(bodies_.size());
    if (!(end.loss < loss)) break;  // the starts moved too far
    bodies_ = problem.at(end.point);
    const bool settled = !(end.loss < (1 - kRoundGain) * loss);
    loss = end.loss;
    if (settled) break;
  }
}

void JointFit::add_posterior() {
  if (adaptation_.samples == 0) return;
  Problem problem(bodies_, variables_, options_);
  const Tensor at = problem.start();
  problem.renew(at);
  std::vector<std::int64_t> columns(static_cast<std::size_t>(at.numel()));
  std::iota(columns.begin(), columns.end(), std::int64_t{0});
  PosteriorOptions how;
  how.samples = adaptation_.samples;
  for (std::size_t k = 0; k < bodies_.size(); ++k)
    how.noise = std::max(how.noise, problem.of(k).noise_over_size());
  std::optional<Progress> progress;
  if (hooks_.progress) {
    progress.emplace("posterior", 0, "samples");
    how.progress = [&](int done) { progress->update(done); };
  }
  const FitPosterior all =
      fit_posterior([&](const Tensor& u) { return problem.residuals(u); }, at, columns,
                    static_cast<int>(problem.motion_size()), problem.seen(), how);
  roll_outs_ += all.evaluations * static_cast<int>(bodies_.size());
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    bodies_[k].posterior = marginal_of(all, std::int64_t(k) * problem.size(), problem.size(),
                                       problem.motion_first(k), problem.of(k).motion_size());
  }
}

FitPosterior marginal_of(const FitPosterior& posterior, std::int64_t first, std::int64_t size,
                         std::int64_t motion_first, std::int64_t motion) {
  FitPosterior own = posterior;
  if (posterior.spread.empty()) return own;
  const auto n = static_cast<Eigen::Index>(posterior.spread.size());
  const Eigen::Map<const Eigen::VectorXd> spread(posterior.spread.data(), n);
  const Eigen::MatrixXd rows = posterior.directions.middleRows(first, size) * spread.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(rows * rows.transpose());
  own.directions = axes.eigenvectors();
  own.spread.clear();
  for (const double square : axes.eigenvalues())
    own.spread.push_back(std::sqrt(std::max(0.0, square)));
  own.determined = static_cast<int>(std::count_if(own.spread.begin(), own.spread.end(),
                                                  [](double s) { return s < kDetermined; }));
  own.samples.clear();
  for (const Tensor& sample : posterior.samples) {
    own.samples.push_back(torch::cat({sample.slice(0, first, first + size),
                                      sample.slice(0, motion_first, motion_first + motion)}));
  }
  return own;
}

}  // namespace uniphy
