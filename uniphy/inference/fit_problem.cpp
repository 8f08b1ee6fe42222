#include "uniphy/inference/fit_problem.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

// Units in which the initial velocity is refined, beside u which is of order one.
constexpr double kLinearUnit = 0.1;   // m/s
constexpr double kAngularUnit = 0.5;  // rad/s

}  // namespace

FitProblem::FitProblem(const Observation& observation, const std::string& name,
                       const FitVariables& variables, const FitOptions& options)
    : observation_(observation),
      name_(name),
      variables_(variables),
      options_(options),
      steps_(observed_steps(observation, name)),
      grid_(observed_grid(observation, name)),
      size_(observed_size(observation)),
      motion_(observed_motion(observation, steps_, grid_, options.velocity_frames)),
      contact_(first_contact(observation, steps_, grid_, motion_)),
      objective_(make_motion_objective(observation, steps_, grid_, options.dtype)) {
  if (options.stages.empty() || options.stages.back().horizon < 1) {
    throw Error("stages: expected a last stage with horizon 1");
  }
  kernels::make_law<double>(variables.law(variables.start(0)));  // a model that does not fit: now
}

std::ptrdiff_t FitProblem::frames(int stage) const {
  return horizon_frames(options_.stages[stage].horizon, contact_, observation_.frames);
}

double FitProblem::horizon_time(int stage) const {
  return static_cast<double>(steps_.last(frames(stage))) * grid_.dt;
}

FitCandidate FitProblem::candidate(int start, const std::vector<double>& u) const {
  FitCandidate c;
  c.start = start;
  c.u = u;
  c.motion = motion_;
  return c;
}

double FitProblem::prior_weight() const {
  return options_.prior / (options_.prior_sigma * options_.prior_sigma);
}

double FitProblem::loss(double mse, const std::vector<double>& u) const {
  const double weight = prior_weight();
  return mse / (size_ * size_) + (weight > 0 ? weight * variables_.prior(u, 0, nullptr) : 0);
}

std::vector<double> FitProblem::frame_mse(const FitCandidate& c, std::ptrdiff_t frames) const {
  return objective_->frame_mse(variables_.law(c.u), c.motion, frames);
}

std::vector<double> FitProblem::evaluate(FitCandidate& c, int stage) const {
  const Evaluation e = objective_->evaluate(variables_.law(c.u), c.motion, frames(stage));
  c.mse = e.mse;
  c.loss = std::isfinite(e.mse) ? loss(e.mse, c.u) : std::numeric_limits<double>::infinity();
  if (!std::isfinite(c.loss)) return {};
  std::vector<double> g = variables_.gradient(c.u, e.parameters);
  const double unit = 1 / (size_ * size_);
  for (double& x : g) x *= unit;
  if (prior_weight() > 0) variables_.prior(c.u, prior_weight(), &g);
  if (with_velocity(stage)) {
    for (int k = 0; k < 6; ++k) {
      g.push_back(unit * (k < 3 ? kLinearUnit : kAngularUnit) * e.motion[k]);
    }
  }
  return g;
}

bool FitProblem::with_velocity(int stage) const {
  return options_.refine_velocity && stage + 1 == stages();
}

std::vector<double> FitProblem::pack(const FitCandidate& c, int stage) const {
  std::vector<double> w = c.u;
  if (!with_velocity(stage)) return w;
  const Eigen::Vector3d linear = (c.motion.linear - motion_.linear) / kLinearUnit;
  const Eigen::Vector3d angular = (c.motion.angular - motion_.angular) / kAngularUnit;
  w.insert(w.end(), linear.data(), linear.data() + 3);
  w.insert(w.end(), angular.data(), angular.data() + 3);
  return w;
}

FitCandidate FitProblem::unpack(int start, const std::vector<double>& variables, int stage) const {
  FitCandidate c = candidate(start, variables);
  if (!with_velocity(stage)) return c;
  const double* extra = variables.data() + variables_.size();
  c.u.resize(variables_.size());
  c.motion.linear += kLinearUnit * Eigen::Map<const Eigen::Vector3d>(extra);
  c.motion.angular += kAngularUnit * Eigen::Map<const Eigen::Vector3d>(extra + 3);
  return c;
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
