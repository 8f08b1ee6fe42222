#include "uniphy/data/drawn_states.hpp"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "uniphy/data/law_branches.hpp"
#include "uniphy/data/material_ranges.hpp"
#include "uniphy/data/random_rotation.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using kernels::LawDescription;
using kernels::LawId;

constexpr double kSmallest = 1e-5;   ///< strain
constexpr double kCompressed = 0.7;  ///< share
/// Near the surface, relative to it: from this on.
constexpr double kNearest = 1e-4;

/// tr ε and ‖ε̂‖.
struct Invariants {
  double trace = 0, deviator = 0;
};

double log_between(UniformRandom& random, double low, double high) {
  return random.log_between(std::min(low, high), high);
}

double random_sign(UniformRandom& random) { return random.unit() < kCompressed ? -1 : 1; }

/// ‖ε‖ = norm, cut between trace and deviator at random.
Invariants split_norm(double norm, double sign, UniformRandom& random) {
  constexpr double kQuarterTurn = 1.5707963267948966;
  const double angle = kQuarterTurn * random.unit();
  return {sign * std::sqrt(3.0) * norm * std::sin(angle), norm * std::cos(angle)};
}

/// How far past the yield surface the trial strain gets: one step, or what steps add up to where a
/// viscous overstress carries them.
double largest_overstep(const LawDescription& law, double dt, const DrawnStateRanges& ranges) {
  if (law.id != LawId::non_newtonian) return ranges.step;
  return std::min(ranges.strain, ranges.step * (1 + law.eta / (2 * law.mu * dt)));
}

/// q on the given side of a yield surface at k: 0 elastic, 1 elastic_near, 2 yield_near, 3 yield.
double around_yield(int place, double k, double elastic, double overstep, UniformRandom& random) {
  switch (place) {
    case 0:
      return log_between(random, 1e-3, kNearBelow) * std::min(k, elastic);
    case 1:
      return k * (1 - log_between(random, kNearest, 1 - kNearBelow));
    case 2:
      return k + log_between(random, kNearest * std::min(k, overstep),
                             std::min((kNearAbove - 1) * k, overstep));
    default:
      return k + log_between(random, std::max(kSmallest, (kNearAbove - 1) * k), overstep);
  }
}

Invariants draw_sand(const LawDescription& law, int branch, const DrawnStateRanges& ranges,
                     UniformRandom& random) {
  if (branch == 0) {
    return {log_between(random, kSmallest, ranges.step),
            log_between(random, kSmallest, ranges.step)};
  }
  // The cone is visited where its radius stays below the largest strain, and for states far
  // outside where one step leads there.
  const double slope = yield_norm(law, -1);
  double most = ranges.strain / std::max(1.0, slope);
  if (branch == 4) most = std::min(most, ranges.step / ((kNearAbove - 1) * slope));
  const double trace = -log_between(random, std::min(kSmallest, 1e-2 * most), most);
  return {trace, around_yield(branch - 1, -slope * trace, ranges.strain, ranges.step, random)};
}

Invariants draw_invariants(const LawDescription& law, double dt, int branch,
                           const DrawnStateRanges& ranges, UniformRandom& random) {
  switch (law.id) {
    case LawId::newtonian:
    case LawId::water: {
      const double most = branch == 1 ? -std::log(0.6) : std::log(1.3);
      const double trace = branch == 0
                               ? log_between(random, 1e-8, kRestStrain)
                               : log_between(random, kRestStrain, std::min(most, ranges.strain));
      const double sign = branch == 0 ? random_sign(random) : branch == 1 ? -1 : 1;
      return {sign * trace, 0};
    }
    case LawId::plasticine:
    case LawId::non_newtonian: {
      const double trace = random_sign(random) * log_between(random, kSmallest, ranges.strain);
      return {trace, around_yield(branch, yield_norm(law, trace), ranges.strain,
                                  largest_overstep(law, dt, ranges), random)};
    }
    case LawId::sand:
      return draw_sand(law, branch, ranges, random);
    default: {
      if (branch == 0) {
        return split_norm(log_between(random, 1e-8, kRestStrain), random_sign(random), random);
      }
      if (branch == 1) {
        return split_norm(log_between(random, kRestStrain, kSmallStrain), random_sign(random),
                          random);
      }
      return split_norm(log_between(random, kSmallStrain, std::max(ranges.strain, kSmallStrain)),
                        branch == 2 ? -1 : 1, random);
    }
  }
}

/// A unit vector whose coordinates sum to 0: uniform over the Lode angle.
Vector3d deviator_direction(UniformRandom& random) {
  constexpr double kTurn = 6.283185307179586;
  const double angle = kTurn * random.unit();
  return Vector3d(1, -1, 0).normalized() * std::cos(angle) +
         Vector3d(1, 1, -2).normalized() * std::sin(angle);
}

Eigen::Matrix3d draw_affine(const DrawnStateRanges& ranges, UniformRandom& random) {
  Eigen::Matrix3d C;
  for (int i = 0; i < 3; ++i) C.row(i) = random.unit() * random.direction().transpose();
  return C * (random.log_between(ranges.affine_low, ranges.affine_high) / C.norm());
}

Eigen::Matrix3d deformation(const LawDescription& law, double dt, const Invariants& invariants,
                            const Eigen::Matrix3d& C, UniformRandom& random) {
  if (law.id == LawId::newtonian || law.id == LawId::water) {
    const Eigen::Matrix3d step = Eigen::Matrix3d::Identity() + dt * C;
    return step * std::cbrt(std::exp(invariants.trace) / step.determinant());
  }
  const Vector3d eps =
      invariants.deviator * deviator_direction(random) + Vector3d::Constant(invariants.trace / 3);
  const Eigen::Matrix3d U = random_rotation(random), V = random_rotation(random);
  return U * eps.array().exp().matrix().asDiagonal() * V.transpose();
}

/// One state, row-major.
struct State {
  double F[9], F_proj[9], C[9], tau[9];
};

void store(const Eigen::Matrix3d& m, double* to) {
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>{to} = m;
}

double norm(const double* m) { return Eigen::Map<const Eigen::Matrix<double, 9, 1>>(m).norm(); }

}  // namespace

bool branch_reachable(const LawDescription& law, double dt, int branch,
                      const DrawnStateRanges& ranges) {
  const bool von_mises = law.id == LawId::plasticine || law.id == LawId::non_newtonian;
  if (!von_mises || branch == 0) return true;
  const double k = yield_norm(law, 0);
  if (kNearAbove * k > ranges.yield_strain) return false;
  return branch != 3 || (kNearAbove - 1) * k < 0.5 * largest_overstep(law, dt, ranges);
}

LawSamples draw_states(const LawDescription& law, double dt, int branch, std::int64_t count,
                       const DrawnStateRanges& ranges, UniformRandom& random) {
  constexpr int kRetries = 40;
  constexpr double kShrink = 0.8;
  const auto kernel = kernels::make_law<double>(law);
  const bool rests = branch_names(law.id)[static_cast<std::size_t>(branch)] == "rest";
  // On the yield surface the deviatoric stress is what it is.
  double largest = ranges.stress;
  if (law.id == LawId::plasticine || law.id == LawId::non_newtonian) {
    largest = std::max(largest, branch == 0 ? 0 : 1.5 * law.tau_y);
  }
  LawSamples samples;
  for (std::int64_t s = 0; s < count; ++s) {
    State state;
    DrawnStateRanges shrinking = ranges;
    for (int retry = 0; retry <= kRetries; ++retry, shrinking.strain *= kShrink) {
      const Invariants invariants = draw_invariants(law, dt, branch, shrinking, random);
      Eigen::Matrix3d C = draw_affine(ranges, random);
      Eigen::Matrix3d F = deformation(law, dt, invariants, C, random);
      if (rests && s % 10 == 0) {
        F.setIdentity();
        C.setZero();
      }
      store(F, state.F);
      store(C, state.C);
      kernel->evaluate(1, dt, {state.F, 9, 1}, {state.C, 9, 1}, {state.F_proj, 9, 1},
                       {state.tau, 9, 1});
      if (norm(state.tau) <= largest) break;
    }
    samples.F.insert(samples.F.end(), state.F, state.F + 9);
    samples.F_proj.insert(samples.F_proj.end(), state.F_proj, state.F_proj + 9);
    samples.C.insert(samples.C.end(), state.C, state.C + 9);
    samples.tau.insert(samples.tau.end(), state.tau, state.tau + 9);
  }
  return samples;
}

}  // namespace uniphy
