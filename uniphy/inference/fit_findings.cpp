#include "uniphy/inference/fit_findings.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numeric>

#include "ops/kernels/laws/law_parameters.hpp"
#include "uniphy/scene/scene_warnings.hpp"

namespace uniphy {
namespace {

/// Over size, of cloud_noise: from here on little more than the path of the centre is seen. A
/// choice: 500 points of a cube of 1000 particles leave 2.5 % (README).
constexpr double kSparseCloud = 0.15;

}  // namespace

bool FittedParameter::outside() const {
  constexpr double kRounding = 1e-6;
  return value < range[0] * (1 - kRounding) || value > range[1] * (1 + kRounding);
}

std::vector<FittedParameter> fitted_parameters(const kernels::LawDescription& law,
                                               const FitVariables& variables) {
  std::vector<FittedParameter> result;
  const std::vector<std::array<double, 2>> ranges = variables.ranges();
  if (ranges.empty()) return result;
  for (const kernels::LawParameter& p : kernels::law_parameters(law.id)) {
    result.push_back({p.name, p.unit, law.*p.member, ranges[result.size()]});
  }
  return result;
}

std::string fit_summary(const FitResult& fit, const FitVariables& variables) {
  if (!fit.determined) return "material not determined\n";
  std::string text;
  for (const FittedParameter& p : fitted_parameters(fit.law, variables)) {
    const auto& [low, high] = p.range;
    text += fmt::format("{} {:.6g} {}", p.name, p.value, p.unit);
    if (low == high) {
      text += ", a constant\n";
    } else {
      text += fmt::format(", {} [{:g}, {:g}]\n", p.outside() ? "OUTSIDE of" : "in", low, high);
    }
  }
  for (const NearestCode& near : variables.nearest(fit.u, 3)) {
    text += fmt::format("near start {} ({}), distance {:.2f}\n", near.code, near.material,
                        near.distance);
  }
  return text;
}

std::vector<std::string> fit_warnings(const Inference& inference, const Observation& observation,
                                      const FitVariables& variables) {
  std::vector<std::string> warnings;
  const auto warn = [&](const std::optional<std::string>& text) {
    if (text) warnings.push_back(*text);
  };
  const FitResult& fit = inference.fit;
  const ObservationCheck& check = inference.check;
  if (fit.contact >= observation.frames) {
    warn(
        "no wall acted before the last frame, and free flight looks alike for every material: "
        "it is not determined; expected an observation that goes on beyond a contact");
  }
  if (!fit.determined && fit.contact < observation.frames) {
    warn(fmt::format(
        "the motion after the first contact, at {:.3g} s of {:.3g} s, determines none of the {} "
        "numbers of the fit to half of what is known beforehand; expected an observation that goes "
        "on for longer, or that has less noise",
        observation.time[fit.contact] - observation.time[0],
        observation.time.back() - observation.time[0], inference.posterior.spread.size()));
  }
  warn(start_warning(check));
  const double volume = std::accumulate(observation.volume.begin(), observation.volume.end(), 0.0);
  warn(sparse_warning(observation.particles, volume, 1.0 / observation.grid));
  const double misfit = std::sqrt(inference.fit_mse);
  const double explained = std::hypot(kLargeMisfit * check.size, 2 * check.noise);
  if (misfit > explained) {
    warn(
        fmt::format("the fit misses the positions by {:.2g} % of the size, where {:.2g} % tell one "
                    "material from another: the law, the scene or the start of the observation is "
                    "not what the fit takes it for, or the fit got stuck",
                    100 * misfit / check.size, 100 * explained / check.size));
  }
  if (!inference.explained) {
    warn(fmt::format(
        "the law found does not explain the motion: it misses the positions by {:.2g} % "
        "of the size, where noise and tolerance account for {:.2g} %; {}",
        100 * inference.misfit.over_size, 100 * inference.misfit.allowed,
        misfit_place(inference.misfit, inference.seen)));
    if (const int degree = observation.start_degree; degree > 0 && degree < kMostStartDegree) {
      warn(
          fmt::format("the state at the first frame is a polynomial of degree {}; start_degree {} "
                      "may leave less",
                      degree, degree + 1));
    }
  }
  if (observation.cloud > 0 && check.noise > kSparseCloud * check.size) {
    warn(
        fmt::format("the first cloud is {:.2g} % of the size away from the body in its place: so "
                    "sparse or noisy clouds tell little; expected more points a frame",
                    100 * check.noise / check.size));
  }
  if (!fit.determined) return warnings;
  for (const FittedParameter& p : fitted_parameters(fit.law, variables)) {
    if (!p.outside()) continue;
    warn(
        fmt::format("law.{}: {:.6g} {} lies outside of its range [{:g}, {:g}], from which starts "
                    "are drawn and which does not bound the fit",
                    p.name, p.value, p.unit, p.range[0], p.range[1]));
  }
  const double off = step_factor(variables.training_dt(), observation.dt);
  if (off > kStepOfFlow * (1 + 1e-9) && flows_by_steps(fit.law)) {
    const double own = nearest_step(variables.training_dt(), observation.dt);
    warn(fmt::format(
        "the model was trained at a time step of {:.3g} s, and here dt is {:.3g} s: the fitted "
        "material flows by a share of what exceeds its yield strain in every step, so that its "
        "code "
        "holds at this dt alone, and the viscosities of the training codes are {:.2g} times as "
        "large here",
        own, observation.dt, observation.dt / own));
  }
  return warnings;
}

}  // namespace uniphy
