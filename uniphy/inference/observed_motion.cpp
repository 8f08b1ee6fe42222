#include "uniphy/inference/observed_motion.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/rollout/rollout.hpp"
#include "uniphy/inference/observed_noise.hpp"
#include "uniphy/scene/memory_check.hpp"

namespace uniphy {
namespace {

using Eigen::Map;
using Eigen::Vector3d;

constexpr std::int64_t kMaximumSteps = 10000000;  ///< of an observation
constexpr double kContactCells = 0.01;  ///< off the free flight, in cells, where a wall acts

/// Where gravity alone takes a point within `steps` steps: the time stepping is symplectic.
Vector3d fall(const kernels::GridSettings& grid, std::ptrdiff_t steps) {
  const double k = static_cast<double>(steps);
  return 0.5 * k * (k + 1) * grid.dt * grid.dt * Map<const Vector3d>(grid.gravity);
}

/// Positions at the first `frames` frames after the start, of a body without stress.
std::vector<double> fly(const kernels::Rollout<double>& rollout, const Observation& observation,
                        const ObservedSteps& steps, int frames, const RigidMotion& motion) {
  const std::vector<double> x(observation.x.begin(),
                              observation.x.begin() + 3 * observation.particles);
  auto state = kernels::ParticleState<double>::undeformed(x, motion.velocities(x));
  std::vector<double> result;
  for (int f = 1; f <= frames; ++f) {
    rollout.run(state, steps.step[f] - steps.step[f - 1]);
    result.insert(result.end(), state.x.begin(), state.x.end());
  }
  return result;
}

/// True where one free flight, its start fitted to all frames, explains the path of the centre of
/// mass: to 1 % of a cell, or, up to 10 %, but for what is no more than the noise of the particles
/// and jumps from frame to frame as noise does and no motion.
bool flies_freely(const Observation& observation, const ObservedSteps& steps,
                  const kernels::GridSettings& grid) {
  const auto frames = static_cast<Eigen::Index>(observation.frames);
  Eigen::Matrix<double, Eigen::Dynamic, 2> basis(frames, 2);
  Eigen::Matrix<double, Eigen::Dynamic, 3> path(frames, 3);
  for (Eigen::Index f = 0; f < frames; ++f) {
    basis.row(f) << 1, static_cast<double>(steps.step[f]) / static_cast<double>(steps.step.back());
    path.row(f) = centre_of_mass(observation, f) - fall(grid, steps.step[f]);
  }
  const Eigen::Matrix<double, 2, 3> start =
      (basis.transpose() * basis).ldlt().solve(basis.transpose() * path);
  path -= basis * start;
  const double largest = path.rowwise().norm().maxCoeff();
  if (largest <= kContactCells * grid.dx()) return true;
  // J. von Neumann, Ann. Math. Stat. 12 (1941): 2 for white noise, 0 for a smooth path.
  const double jumps =
      (path.bottomRows(frames - 1) - path.topRows(frames - 1)).squaredNorm() / path.squaredNorm();
  return jumps > 1 && largest <= 10 * kContactCells * grid.dx() &&
         largest <= 5 * observed_noise(observation);
}

}  // namespace

Vector3d centre_of_mass(const Observation& observation, std::ptrdiff_t frame) {
  const double* x = observation.positions(frame);
  Vector3d sum = Vector3d::Zero();
  double total = 0;
  for (std::int64_t p = 0; p < observation.particles; ++p) {
    sum += observation.volume[p] * Map<const Vector3d>(x + 3 * p);
    total += observation.volume[p];
  }
  return sum / total;
}

ObservedSteps observed_steps(const Observation& observation, const std::string& name) {
  ObservedSteps result;
  const double all = (observation.time.back() - observation.time.front()) / observation.dt;
  if (all > double(kMaximumSteps)) {
    throw Error(
        fmt::format("{}: attribute dt of /scene: expected at most {} time steps from the "
                    "first frame to the last, found {:.0f}",
                    name, kMaximumSteps, all));
  }
  std::ptrdiff_t divisor = 0;
  for (std::size_t f = 0; f < observation.time.size(); ++f) {
    const double steps = (observation.time[f] - observation.time[0]) / observation.dt;
    const double whole = std::round(steps);
    if (std::abs(steps - whole) > 0.01 || (f > 0 && whole < 1)) {
      throw Error(fmt::format(
          "{}: /time: expected frames at whole multiples of dt = {} s, found {} s at frame {}",
          name, observation.dt, observation.time[f], f));
    }
    result.step.push_back(static_cast<std::ptrdiff_t>(whole));
    divisor = std::gcd(divisor, result.step.back());
  }
  result.stride = divisor;
  return result;
}

kernels::GridSettings observed_grid(const Observation& observation, const std::string& name) {
  kernels::GridSettings grid;
  grid.n = observation.grid;
  grid.dt = observation.dt;
  std::copy(observation.gravity.begin(), observation.gravity.end(), grid.gravity);
  grid.wall = observation.walls == "noslip" ? kernels::Wall::noslip : kernels::Wall::freeslip;
  grid.bound = observation.bound;
  try {
    grid.check();
    check_grid_memory("grid", grid.n, sizeof(double));
  } catch (const Error& error) {
    throw Error(fmt::format("{}: /scene: {}", name, error.what()));
  }
  return grid;
}

std::vector<double> observed_mass(const Observation& observation) {
  std::vector<double> mass = observation.volume;
  for (double& m : mass) m *= observation.density;
  return mass;
}

Observation first_frames(const Observation& observation, std::ptrdiff_t frames) {
  Observation part = observation;
  part.frames = frames;
  part.time.resize(static_cast<std::size_t>(frames));
  part.x.resize(static_cast<std::size_t>(3 * frames * observation.particles));
  return part;
}

double observed_size(const Observation& observation) {
  Vector3d low = Map<const Vector3d>(observation.positions(0)), high = low;
  for (std::int64_t p = 1; p < observation.particles; ++p) {
    const auto x = Map<const Vector3d>(observation.positions(0) + 3 * p);
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  return (high - low).maxCoeff();
}

RigidMotion observed_motion(const Observation& observation, const ObservedSteps& steps,
                            const kernels::GridSettings& grid, int frames) {
  frames = static_cast<int>(std::min<std::int64_t>(frames, observation.frames - 1));
  RigidMotion motion;
  motion.centre = centre_of_mass(observation, 0);
  Vector3d moment = Vector3d::Zero();
  double weight = 0;
  for (int f = 1; f <= frames; ++f) {
    const double t = static_cast<double>(steps.step[f]) * grid.dt;
    moment += t * (centre_of_mass(observation, f) - motion.centre - fall(grid, steps.step[f]));
    weight += t * t;
  }
  motion.linear = moment / weight;

  kernels::LawDescription limp;  // as good as no stress: moduli of 1e-3 Pa
  limp.mu = limp.lambda = 1e-3;
  const kernels::Rollout<double> rollout(
      grid, {{0, observation.particles, kernels::make_law<double>(limp)}},
      observed_mass(observation), observation.volume);
  const double* seen = observation.positions(1);
  for (int iteration = 0; iteration < 3; ++iteration) {
    const std::vector<double> flown = fly(rollout, observation, steps, frames, motion);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Vector3d right = Vector3d::Zero();
    Eigen::Matrix<double, Eigen::Dynamic, 3> slope(static_cast<Eigen::Index>(flown.size()), 3);
    for (int axis = 0; axis < 3; ++axis) {
      RigidMotion turned = motion;
      turned.angular[axis] += 1;  // the response is linear but for the motion of the particles
      const std::vector<double> moved = fly(rollout, observation, steps, frames, turned);
      for (std::size_t k = 0; k < flown.size(); ++k) slope(k, axis) = moved[k] - flown[k];
    }
    for (std::size_t k = 0; k < flown.size(); ++k) {
      normal += slope.row(k).transpose() * slope.row(k);
      right += slope.row(k).transpose() * (seen[k] - flown[k]);
    }
    // A body that is a point or a line along an axis does not show its rotation about it.
    normal.diagonal().array() += 1e-12 * normal.trace() + 1e-300;
    motion.angular += normal.ldlt().solve(right);
  }
  return motion;
}

std::ptrdiff_t first_contact(const Observation& observation, const ObservedSteps& steps,
                             const kernels::GridSettings& grid, const RigidMotion& motion) {
  if (flies_freely(observation, steps, grid)) return observation.frames;
  for (std::ptrdiff_t f = 1; f < observation.frames; ++f) {
    const double t = static_cast<double>(steps.step[f]) * grid.dt;
    const Vector3d free = motion.centre + t * motion.linear + fall(grid, steps.step[f]);
    if ((centre_of_mass(observation, f) - free).norm() > kContactCells * grid.dx()) return f;
  }
  return observation.frames;
}

}  // namespace uniphy
