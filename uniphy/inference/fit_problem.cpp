#include "uniphy/inference/fit_problem.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/observed_noise.hpp"
#include "uniphy/inference/start_correction.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// Noise over size above which the gradients fit the initial velocity, too: below it the positions
/// of the first frames tell it better than a law that is still far off.
constexpr double kNoisy = 1e-4;
/// From here on the starts of the points are fitted. Below it, what they are off by is no more than
/// a law from outside of the family leaves.
constexpr double kNoisyStarts = 1e-3;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Units of the change of an initial state, and of the polynomials beside its rigid motion.
constexpr double kLinearUnit = 0.1;   // m/s
constexpr double kAngularUnit = 0.5;  // rad/s, 1/s
constexpr double kStretchUnit = 0.05;

Tensor units_of(int degree) {
  Tensor units = torch::full({initial_numbers(degree)}, kStretchUnit, torch::kFloat64);
  units.slice(0, 0, velocity_numbers(degree)) = kLinearUnit;
  units.slice(0, 3, velocity_numbers(std::min(degree, 1))) = kAngularUnit;
  return units;
}

/// Where all that is rolled out stands at the first frame.
std::vector<double> starts_of(const Observation& observation) {
  std::vector<double> x = observation.start();
  x.insert(x.end(), observation.tracers.begin(), observation.tracers.end());
  return x;
}

}  // namespace

FitProblem::FitProblem(const Observation& observation, const std::string& name,
                       const FitVariables& variables, const FitOptions& options,
                       const InitialState* motion)
    : observation_(observation),
      name_(name),
      variables_(variables),
      options_(options),
      steps_(observed_steps(observation, name)),
      grid_(observed_grid(observation, name)),
      size_(observed_size(observation)),
      motion_(motion != nullptr ? *motion : observed_motion(observation, steps_, grid_)),
      contact_(first_contact(observation, steps_, grid_, motion_)),
      noise_(observed_noise(observation)),
      fits_velocity_(observation.tracked() || noise_ > kNoisy * size_ ||
                     observation.start_degree > 0 || observation.cloud > 0 ||
                     meets_by(observation, 1)),
      fits_starts_(observation.cloud == 0 &&
                   (observation.tracked() || noise_ > kNoisyStarts * size_)),
      basis_(starts_of(observation), observation.particles, motion_),
      observed_(numbers_of(motion_)),
      units_(units_of(motion_.degree)),
      objective_(make_motion_objective(observation, steps_, grid_, options.dtype, options.rollout,
                                       options.detail, options.companions)) {
  if (options.stages.empty() || options.stages.back().horizon < 1) {
    throw Error("stages: expected a last stage with horizon 1");
  }
  kernels::make_law<double>(variables.law(variables.start(0)));  // a model that does not fit: now
  if (observation.cloud > 0) return;
  const Tensor hidden = torch::tensor(observation.x, torch::kFloat64).isnan();
  if (hidden.any().item<bool>()) hidden_ = hidden.view({observation.frames, -1});
}

std::ptrdiff_t FitProblem::frames(int stage) const {
  return horizon_frames(options_.stages[stage].horizon, contact_, observation_.frames);
}

double FitProblem::seen(std::ptrdiff_t frames) const {
  return objective_->seen_per_frame() * static_cast<double>(frames);
}

double least_pull(double noise, double coordinates) {
  return std::max(1e-6, noise / std::sqrt(coordinates));
}

double FitProblem::least_pull(std::ptrdiff_t frames) const {
  return uniphy::least_pull(noise_ / size_, seen(frames));
}

double FitProblem::horizon_time(int stage) const {
  return static_cast<double>(steps_.last(frames(stage))) * grid_.dt;
}

FitCandidate FitProblem::candidate(int start) const {
  FitCandidate c;
  c.start = start;
  c.u = torch::tensor(variables_.start(start), torch::kFloat64);
  c.motion = torch::zeros({motion_size()}, torch::kFloat64);
  return c;
}

InitialState FitProblem::motion(const FitCandidate& c) const {
  return with_numbers(motion_, observed_ + units_ * c.motion);
}

std::vector<double> FitProblem::frame_mse(const FitCandidate& c, std::ptrdiff_t frames) const {
  return objective_->frame_mse(variables_.law(c.u), motion(c), frames);
}

double FitProblem::prior_weight() const {
  return options_.prior / (options_.prior_sigma * options_.prior_sigma);
}

Tensor FitProblem::loss_of(const Tensor& mse, const Tensor& u) const {
  Tensor loss = mse / (size_ * size_);
  const Tensor prior = prior_weight() > 0 ? variables_.prior(u) : Tensor();
  if (prior.defined()) loss = loss + prior_weight() * prior;
  const Tensor departure = options_.pull > 0 ? variables_.departure(u) : Tensor();
  return departure.defined() ? loss + options_.pull * departure : loss;
}

Tensor FitProblem::misses(const Tensor& point, std::ptrdiff_t frames) const {
  const torch::NoGradGuard no_grad;
  const std::int64_t size = variables_.size();
  const Tensor change = point.numel() > size ? point.slice(0, size) : torch::zeros_like(observed_);
  return objective_->residuals(variables_.body(point.slice(0, 0, size), observation_.particles),
                               fields(change), frames);
}

InitialState FitProblem::motion_at(const Tensor& point) const {
  FitCandidate at;
  at.motion = point.numel() > variables_.size() ? point.slice(0, variables_.size())
                                                : torch::zeros_like(observed_);
  return motion(at);
}

Tensor FitProblem::change_to(const InitialState& to) const {
  return (numbers_of(to) - observed_) / units_;
}

StartCorrection FitProblem::start_correction(const Tensor& point, std::ptrdiff_t frames) const {
  return {objective_->flow_gradients(variables_.law(point.slice(0, 0, variables_.size())),
                                     motion_at(point), frames),
          hidden_};
}

Tensor FitProblem::residuals(const Tensor& point, std::ptrdiff_t frames,
                             const StartCorrection* starts) const {
  const torch::NoGradGuard no_grad;
  try {
    Tensor r = misses(point, frames);
    if (starts != nullptr) r = starts->remaining(r);
    const std::int64_t P = r.size(1) / 3, all = r.numel();
    r = r.view({frames, P, 3});
    const std::int64_t most = most_residuals(point.numel());
    const std::int64_t stride = (all + most - 1) / most;
    if (stride > 1) r = r.slice(1, 0, P, stride);
    const double seen = objective_->seen_per_frame() / static_cast<double>(3 * P);
    r = r.flatten() / (size_ * std::sqrt(static_cast<double>(r.numel()) * seen));
    if (!r.isfinite().all().item<bool>()) return {};
    const Tensor u = point.slice(0, 0, variables_.size());
    const Tensor prior = prior_weight() > 0 ? variables_.prior(u) : Tensor();
    return prior.defined() ? torch::cat({r, (prior_weight() * prior).sqrt().view({1})}) : r;
  } catch (const Error&) {  // the roll-out failed
    return {};
  }
}

std::int64_t FitProblem::most_residuals(std::int64_t columns) {
  return std::min(kMostResiduals, kMostInJacobian / std::max<std::int64_t>(columns, 1));
}

double FitProblem::loss(double mse, const Tensor& u) const {
  torch::NoGradGuard no_grad;
  return loss_of(torch::scalar_tensor(mse, torch::kFloat64), u).item<double>();
}

double FitProblem::mse_of(double loss, const Tensor& u) const {
  const double of_u = this->loss(0, u);
  return (loss - of_u) * size_ * size_;
}

bool FitProblem::with_velocity(int stage) const {
  if (stage + 1 < stages()) return false;
  return fits_velocity_ || options_.stages[stage].optimizer == kLevenbergMarquardt;
}

std::vector<Tensor> FitProblem::leaves(const FitCandidate& c, int stage) const {
  std::vector<Tensor> result{c.u.clone().requires_grad_()};
  if (with_velocity(stage)) result.push_back(c.motion.clone().requires_grad_());
  return result;
}

InitialFields FitProblem::fields(const Tensor& change) const {
  return basis_.fields(observed_ + units_ * change);
}

FitProblem::Evaluation FitProblem::evaluate(const std::vector<Tensor>& leaves, int stage) const {
  const torch::AutoGradMode with_gradient(true);
  for (const Tensor& leaf : leaves) leaf.mutable_grad() = Tensor();
  try {
    const ops::RolloutBody body = variables_.body(leaves[0], observation_.particles);
    const Tensor change = leaves.size() > 1 ? leaves[1] : torch::zeros_like(observed_);
    const Tensor mse = objective_->mse(body, fields(change), frames(stage));
    const Tensor loss = loss_of(mse, leaves[0]);
    loss.backward();
    bool finite = std::isfinite(loss.item<double>());
    for (const Tensor& leaf : leaves) finite = finite && leaf.grad().isfinite().all().item<bool>();
    if (finite) return {loss.detach(), mse.item<double>()};
  } catch (const Error&) {  // the roll-out failed
  }
  for (const Tensor& leaf : leaves) leaf.mutable_grad() = Tensor();
  return {torch::scalar_tensor(kInfinity, torch::kFloat64), kInfinity};
}

void FitProblem::refuse_starts() const {
  std::string reason = "the positions are not finite";
  try {
    objective_->simulate(variables_.law(variables_.start(0)), motion_,
                         [](std::ptrdiff_t, const std::vector<double>&) {});
  } catch (const Error& error) {
    reason = error.what();
  }
  throw Error(fmt::format(
      "{}: expected that at least one of {} starts can be simulated for {} s, found none; the "
      "first: {}",
      name_, variables_.starts(), horizon_time(0), reason));
}

}  // namespace uniphy
