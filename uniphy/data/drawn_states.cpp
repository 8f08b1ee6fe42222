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

constexpr double kSmallest = 1e-5;     ///< strain
constexpr double kLargestStep = 0.05;  ///< of a trial strain past the yield surface
constexpr double kCompressed = 0.7;    ///< share
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

/// q on the given side of a yield surface at k: 0 elastic, 1 elastic_near, 2 yield_near, 3 yield.
double around_yield(int place, double k, double farthest, UniformRandom& random) {
  switch (place) {
    case 0:
      return log_between(random, 1e-3, kNearBelow) * std::min(k, farthest);
    case 1:
      return k * (1 - log_between(random, kNearest, 1 - kNearBelow));
    case 2:
      return k * (1 + log_between(random, kNearest, kNearAbove - 1));
    default: {
      const double least = std::max(kSmallest, (kNearAbove - 1) * k);
      return k + log_between(random, least, std::max({farthest, 2 * least, kLargestStep}));
    }
  }
}

Invariants draw_sand(const LawDescription& law, int branch, const DrawnStateRanges& ranges,
                     UniformRandom& random) {
  if (branch == 0) {
    return {log_between(random, kSmallest, kLargestStep),
            log_between(random, kSmallest, kLargestStep)};
  }
  // The cone is visited where its radius stays below the largest strain.
  const double slope = yield_norm(law, -1);
  const double most = ranges.strain / std::max({1.0, slope, std::sqrt(1.0 / 3)});
  const double trace = -log_between(random, std::min(kSmallest, 1e-2 * most), most);
  return {trace, around_yield(branch - 1, -slope * trace, kLargestStep, random)};
}

Invariants draw_invariants(const LawDescription& law, int branch, const DrawnStateRanges& ranges,
                           UniformRandom& random) {
  switch (law.id) {
    case LawId::newtonian:
    case LawId::water: {
      const double deviator = log_between(random, 1e-6, 1e-2);
      if (branch == 0)
        return {random_sign(random) * log_between(random, 1e-8, kRestStrain), deviator};
      const double most = branch == 1 ? -std::log(0.6) : std::log(1.3);
      const double trace = log_between(random, kRestStrain, std::min(most, ranges.strain));
      return {branch == 1 ? -trace : trace, deviator};
    }
    case LawId::plasticine:
    case LawId::non_newtonian: {
      const double trace = random_sign(random) * log_between(random, kSmallest, ranges.strain);
      const double farthest =
          branch == 0 || law.id == LawId::non_newtonian ? ranges.strain : kLargestStep;
      return {trace, around_yield(branch, yield_norm(law, trace), farthest, random)};
    }
    case LawId::sand:
      return draw_sand(law, branch, ranges, random);
    default:
      if (branch == 0)
        return split_norm(log_between(random, 1e-8, kRestStrain), random_sign(random), random);
      if (branch == 1)
        return split_norm(log_between(random, kRestStrain, kSmallStrain), random_sign(random),
                          random);
      return split_norm(log_between(random, kSmallStrain, std::max(ranges.strain, kSmallStrain)),
                        branch == 2 ? -1 : 1, random);
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

void append(const Eigen::Matrix3d& m, std::vector<double>& to) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) to.push_back(m(i, j));
}

}  // namespace

bool branch_reachable(const LawDescription& law, int branch, const DrawnStateRanges& ranges) {
  const bool von_mises = law.id == LawId::plasticine || law.id == LawId::non_newtonian;
  return !von_mises || branch == 0 || kNearAbove * yield_norm(law, 0) <= ranges.yield_strain;
}

LawSamples draw_states(const LawDescription& law, double dt, int branch, std::int64_t count,
                       const DrawnStateRanges& ranges, UniformRandom& random) {
  LawSamples samples;
  const bool rests = branch_names(law.id)[static_cast<std::size_t>(branch)] == "rest";
  for (std::int64_t s = 0; s < count; ++s) {
    const Invariants invariants = draw_invariants(law, branch, ranges, random);
    const Vector3d eps =
        invariants.deviator * deviator_direction(random) + Vector3d::Constant(invariants.trace / 3);
    const Eigen::Matrix3d U = random_rotation(random), V = random_rotation(random);
    Eigen::Matrix3d F = U * eps.array().exp().matrix().asDiagonal() * V.transpose();
    Eigen::Matrix3d C = draw_affine(ranges, random);
    if (rests && s % 10 == 0) {
      F.setIdentity();
      C.setZero();
    }
    append(F, samples.F);
    append(C, samples.C);
  }
  samples.F_proj.resize(samples.F.size());
  samples.tau.resize(samples.F.size());
  const auto kernel = kernels::make_law<double>(law);
  for (std::int64_t s = 0; s < count; s += kernels::kLawChunk) {
    const std::int64_t n = std::min<std::int64_t>(kernels::kLawChunk, count - s);
    const auto at = 9 * s;
    kernel->evaluate(n, dt, {samples.F.data() + at, 9, 1}, {samples.C.data() + at, 9, 1},
                     {samples.F_proj.data() + at, 9, 1}, {samples.tau.data() + at, 9, 1});
  }
  return samples;
}

}  // namespace uniphy
