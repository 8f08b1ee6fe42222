#include "uniphy/data/random_law_samples.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/statistics.hpp"
#include "ops/kernels/spectral/spectral.hpp"
#include "uniphy/data/material_ranges.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using Mat3 = kernels::Mat3<double>;

constexpr int kDraws = 200;              ///< about two in three solids are stable at once
constexpr double kHighQuantile = 0.995;  ///< what the states reach; a few wild ones do not count
constexpr double kScaled = 0.75;         ///< part of the laws whose states are scaled
constexpr double kLargestStrain = 1;     ///< of one principal direction, or |log J|
constexpr double kLargestDeviator = 0.6;
constexpr double kRest = 1e-9;       ///< strain of a state at rest
constexpr int kCheckedStates = 200;  ///< of a law's tangent
/// Rates of flow (1/s) that lead beyond a yield surface: those of drawn affine velocities.
constexpr double kSlowest = 0.1, kFastest = 200;

/// A state, decomposed.
struct State {
  Mat3 U, V, C;
  Vector3d eps;

  State(const LawSamples& samples, std::int64_t s) {
    Mat3 F;
    std::copy_n(&samples.F[9 * s], 9, F.e);
    std::copy_n(&samples.C[9 * s], 9, C.e);
    const auto svd = kernels::svd3(F);
    const auto strain = kernels::hencky_strain(svd.sigma, false);
    U = svd.U;
    V = svd.V_;
    eps = {strain.eps[0], strain.eps[1], strain.eps[2]};
  }
  Mat3 deformation() const {
    const Vector3d s = eps.array().exp();
    return kernels::compose(U, {{s[0], s[1], s[2]}}, V);
  }
};

std::vector<State> decompose(const LawSamples& samples) {
  std::vector<State> states;
  for (std::int64_t s = 0; s < samples.size(); ++s) states.emplace_back(samples, s);
  return states;
}

/// What the values reach.
template <class Value>
double reach(const std::vector<State>& states, const Value& value) {
  std::vector<double> all;
  for (const State& s : states) all.push_back(value(s));
  return std::max(kRest, kernels::quantile(std::move(all), kHighQuantile));
}
double largest_strain(const std::vector<State>& states) {
  double largest = kRest;
  for (const State& s : states) largest = std::max(largest, s.eps.cwiseAbs().maxCoeff());
  return largest;
}
double largest_trace(const std::vector<State>& states) {
  double largest = kRest;
  for (const State& s : states) largest = std::max(largest, std::abs(s.eps.sum()));
  return largest;
}

std::vector<Vector3d> checked_strains(const std::vector<State>& states) {
  std::vector<Vector3d> strains;
  const std::size_t stride = std::max<std::size_t>(1, states.size() / kCheckedStates);
  for (std::size_t s = 0; s < states.size(); s += stride) strains.push_back(states[s].eps);
  return strains;
}

LawSamples answer(const RandomLaw& law, const std::vector<Mat3>& F,
                  const std::vector<State>& states, double dt) {
  LawSamples samples;
  for (std::size_t s = 0; s < states.size(); ++s) {
    const Mat3& C = states[s].C;
    double F_proj[9], tau[9];
    law.evaluate(dt, F[s].e, C.e, F_proj, tau);
    samples.F.insert(samples.F.end(), F[s].e, F[s].e + 9);
    samples.F_proj.insert(samples.F_proj.end(), F_proj, F_proj + 9);
    samples.C.insert(samples.C.end(), C.e, C.e + 9);
    samples.tau.insert(samples.tau.end(), tau, tau + 9);
  }
  samples.source.assign(states.size(), kDrawnSample);
  return samples;
}

/// The factor that makes what reaches `from` reach a strain between low and high; 1 at times.
double strain_factor(double from, double largest, double low, double high, UniformRandom& random) {
  const double target = random.log_between(low, high);
  if (random.unit() >= kScaled) return 1;
  return std::min(target / from, kLargestStrain / largest);
}

std::optional<RandomLawSamples> draw_solid(std::vector<State> states, double dt,
                                           UniformRandom& random) {
  const double factor = strain_factor(reach(states, [](const State& s) { return s.eps.norm(); }),
                                      largest_strain(states), 0.05, 0.6, random);
  RandomLawSamples result;
  result.law.kind = RandomLawKind::solid;
  MaterialParameters unit;
  for (double& u : unit) u = random.unit();
  const kernels::LawDescription family = material_at(default_material_ranges().front(), unit);
  result.law.elasticity = draw_elasticity(family.mu, family.lambda, random);
  std::vector<Mat3> F;
  for (State& s : states) {
    s.eps *= factor;
    F.push_back(s.deformation());
  }
  if (!result.law.elasticity.stable(checked_strains(states))) return {};
  result.samples = answer(result.law, F, states, dt);
  return result;
}

double shear_rate(const Mat3& C) {
  const Mat3 D = kernels::sym(C);
  const double trace = kernels::trace(D);
  return std::sqrt(2 * std::max(0.0, kernels::dot(D, D) - trace * trace / 3));
}

std::optional<RandomLawSamples> draw_fluid(std::vector<State> states, double dt,
                                           UniformRandom& random) {
  const double seen = reach(states, [](const State& s) { return std::abs(s.eps.sum()); });
  const double factor = strain_factor(seen, largest_trace(states), 0.005, 0.4, random);
  const double faster = random.log_between(0.3, 3);
  RandomLawSamples result;
  RandomLaw& law = result.law;
  law.kind = RandomLawKind::fluid;
  // The slope of the pressure of newtonian at J = 1, 7 (2/3 mu + lambda), reaches from 440 Pa.
  law.elasticity.state = draw_equation_of_state(random.log_between(500, 3.5e6), true, random);
  law.whole_rate = random.unit() < 0.5;
  law.viscosity = draw_viscosity(
      faster * reach(states, [](const State& s) { return shear_rate(s.C); }), random);
  std::vector<Mat3> F;
  for (State& s : states) {
    s.C = s.C * faster;
    double log_J = factor * s.eps.sum();
    // Most states of a fluid are near rest; a splash is not.
    const double spread = random.unit(), place = random.unit();
    if (spread < 0.5) log_J = std::copysign(factor * seen * place * place, log_J);
    if (!law.elasticity.state.stable(log_J)) return {};
    const Mat3 step = kernels::identity3<double>() + s.C * dt;
    const double J = kernels::determinant(step);
    if (!(J > 0)) return {};
    F.push_back(step * std::cbrt(std::exp(log_J) / J));
  }
  result.samples = answer(law, F, states, dt);
  return result;
}

/// A unit vector whose coordinates sum to 0.
Vector3d deviator_direction(const Vector3d& eps, UniformRandom& random) {
  Vector3d dev = eps.array() - eps.mean();
  while (dev.norm() < kRest) {
    dev = random.direction();
    dev.array() -= dev.mean();
  }
  return dev.normalized();
}

/// One step of flow from the surface at `at`.
double step_beyond(double dt, UniformRandom& random) {
  return dt * random.log_between(kSlowest, kFastest);
}

/// A strain near the surface of the law, with its trace where `trace` asks for it as far as one
/// step leads there.
Vector3d strain_near(const RandomYield& yield, double trace, const Vector3d& direction, double dt,
                     UniformRandom& random) {
  const double to = yield.cap.returned_trace(trace);
  if (trace != to) {
    const double step = step_beyond(dt, random);
    trace = to + std::clamp(trace - to, -step, step);
  }
  const double radius = yield.cap.radius(to, direction);
  const double side = random.unit();
  double q = radius * random.log_between(1e-3, 0.8);
  if (side < 0.5 || radius == 0) {
    const double flow = random.log_between(kSlowest, kFastest);
    const double held =
        random.unit() < 0.5 ? 1 : random.unit();  // steady flow, or on the way there
    q = radius + held * yield.rate.beyond(flow) + dt * flow;
  } else if (side < 0.7) {
    q = radius * (1 - random.log_between(1e-4, 0.2));
  }
  if (q > kLargestDeviator) q = kLargestDeviator * random.log_between(1e-3, 1);
  return q * direction + Vector3d::Constant(trace / 3);
}

bool yields_often(const RandomYield& yield, const std::vector<State>& states, double dt) {
  constexpr std::size_t kShare = 10;  // at least one state in so many
  const auto count = std::count_if(states.begin(), states.end(), [&](const State& s) {
    return yield.project(s.eps, dt) != s.eps;
  });
  return kShare * static_cast<std::size_t>(count) >= states.size();
}

std::optional<RandomLawSamples> draw_plastic(std::vector<State> states, bool of_sand, double dt,
                                             UniformRandom& random) {
  const double from = reach(states, [](const State& s) { return std::abs(s.eps.sum()); });
  const double factor = strain_factor(from, largest_trace(states), 0.02, 0.4, random);
  RandomLawSamples result;
  RandomLaw& law = result.law;
  law.kind = RandomLawKind::plastic;
  const double mu = random.log_between(1e3, 5e6), lambda = random.log_between(1e3, 5e6);
  law.elasticity =
      random.unit() < 0.7 ? hencky_elasticity(mu, lambda) : draw_elasticity(mu, lambda, random);
  law.yield = draw_yield(mu, lambda + 2.0 / 3 * mu, factor * from, random);
  const double apex = law.yield.cap.apex, shift = of_sand && std::isfinite(apex) ? apex : 0;
  std::vector<Mat3> F;
  std::vector<State> projected = states;
  for (std::size_t i = 0; i < states.size(); ++i) {
    State& s = states[i];
    if (s.eps.norm() >= kRest) {
      s.eps = strain_near(law.yield, factor * s.eps.sum() + shift,
                          deviator_direction(s.eps, random), dt, random);
    }
    F.push_back(s.deformation());
    projected[i].eps = law.yield.project(s.eps, dt);
  }
  if (!yields_often(law.yield, states, dt)) return {};
  if (!law.elasticity.stable(checked_strains(projected))) return {};
  result.samples = answer(law, F, states, dt);
  return result;
}

}  // namespace

RandomLawSamples draw_random_law(RandomLawKind kind, const LawSamples& states,
                                 const std::string& material, double dt, std::uint64_t seed) {
  UniformRandom random(seed);
  const std::vector<State> decomposed = decompose(states);
  for (int draw = 0; draw < kDraws; ++draw) {
    std::optional<RandomLawSamples> drawn;
    if (kind == RandomLawKind::solid) drawn = draw_solid(decomposed, dt, random);
    if (kind == RandomLawKind::fluid) drawn = draw_fluid(decomposed, dt, random);
    if (kind == RandomLawKind::plastic)
      drawn = draw_plastic(decomposed, material == "sand", dt, random);
    if (drawn) return *std::move(drawn);
  }
  throw Error(std::string(random_law_name(kind)) + ": no law in " + std::to_string(kDraws) +
              " draws stays stable on the states of a trajectory of " + material);
}

}  // namespace uniphy
