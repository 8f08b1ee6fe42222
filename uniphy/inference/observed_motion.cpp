#include "uniphy/inference/observed_motion.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numeric>
#include <utility>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/tracer.hpp"
#include "ops/kernels/rollout/rollout.hpp"
#include "uniphy/inference/cloud_motion.hpp"
#include "uniphy/inference/deformed_start.hpp"
#include "uniphy/inference/misfit.hpp"
#include "uniphy/inference/observed_frames.hpp"
#include "uniphy/inference/observed_noise.hpp"
#include "uniphy/scene/memory_check.hpp"

namespace uniphy {
namespace {

using Eigen::Map;
using Eigen::Vector3d;

constexpr std::int64_t kMaximumSteps = 10000000;  ///< of an observation
constexpr double kContactCells = 0.01;  ///< off the free flight, in cells, where a wall acts

/// Noise over size below which one frame tells the velocity. A choice.
constexpr double kLittleNoise = 1e-4;

/// Time of a frame in steps.
double steps_to(const ObservedSteps& steps, std::ptrdiff_t frame) {
  return static_cast<double>(steps.step[frame]) + steps.fraction[frame];
}

/// Where gravity alone takes a point by a frame: the time stepping is symplectic.
Vector3d fall(const kernels::GridSettings& grid, const ObservedSteps& steps, std::ptrdiff_t frame) {
  const double k = static_cast<double>(steps.step[frame]), share = steps.fraction[frame];
  const double whole = 0.5 * k * (k + 1) + share * (k + 1);
  return whole * grid.dt * grid.dt * Map<const Vector3d>(grid.gravity);
}

/// Free flight of the body without stress, as the simulation has it.
class Flight {
 public:
  Flight(const Observation& observation, const ObservedSteps& steps,
         const kernels::GridSettings& grid, int frames)
      : steps_(steps),
        frames_(frames),
        first_(observation.tracked() ? 3 * observation.particles : 0),
        start_(observation.start()),
        rollout_(make(observation, grid)) {
    start_.insert(start_.end(), observation.tracers.begin(), observation.tracers.end());
    // A point that is hidden at the first frame does not count; it stands with the first particle.
    for (std::size_t k = 0; k < start_.size(); ++k) {
      if (std::isnan(start_[k])) start_[k] = start_[k % 3];
    }
  }

  /// Positions of the points [frames, points, 3] at the frames after the first one.
  std::vector<double> fly(const RigidMotion& motion) const {
    std::vector<double> result;
    visit_frames(rollout_,
                 kernels::ParticleState<double>::undeformed(start_, motion.velocities(start_)),
                 steps_, frames_ + 1, [&](std::ptrdiff_t frame, const std::vector<double>& x) {
                   if (frame > 0) result.insert(result.end(), x.begin() + first_, x.end());
                 });
    return result;
  }

 private:
  static kernels::Rollout<double> make(const Observation& observation,
                                       const kernels::GridSettings& grid) {
    kernels::LawDescription limp;  // as good as no stress: moduli of 1e-3 Pa
    limp.mu = limp.lambda = 1e-3;
    const std::ptrdiff_t P = observation.particles,
                         Q = observation.tracked() ? observation.points() : 0;
    std::vector<kernels::BodyRange<double>> bodies{{0, P, kernels::make_law<double>(limp)}};
    std::vector<double> mass = observed_mass(observation), volume = observation.volume;
    if (Q > 0) bodies.push_back({P, P + Q, std::make_shared<const kernels::Tracer<double>>()});
    mass.resize(P + Q, 0.0);
    volume.resize(P + Q, 0.0);
    return {grid, bodies, mass, volume};
  }

  const ObservedSteps& steps_;
  int frames_;
  std::ptrdiff_t first_;  ///< number of the points' first coordinate
  std::vector<double> start_;
  kernels::Rollout<double> rollout_;
};

/// True where one free flight, its start fitted to all frames, explains the path of the centre of
/// mass: to 1 % of a cell, or, up to 10 %, but for what is no more than the noise of the particles
/// and jumps from frame to frame as noise does and no motion.
bool flies_freely(const Observation& observation, const ObservedSteps& steps,
                  const kernels::GridSettings& grid) {
  const auto frames = static_cast<Eigen::Index>(observation.frames);
  Eigen::Matrix<double, Eigen::Dynamic, 2> basis(frames, 2);
  Eigen::Matrix<double, Eigen::Dynamic, 3> path(frames, 3);
  for (Eigen::Index f = 0; f < frames; ++f) {
    basis.row(f) << 1, steps_to(steps, f) / steps_to(steps, frames - 1);
    path.row(f) = centre_of_mass(observation, f) - fall(grid, steps, f);
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

Vector3d centre_of(const Observation& observation, const double* x) {
  Vector3d sum = Vector3d::Zero();
  double total = 0;
  for (std::int64_t p = 0; p < observation.particles; ++p) {
    sum += observation.volume[p] * Map<const Vector3d>(x + 3 * p);
    total += observation.volume[p];
  }
  return sum / total;
}

/// What positions at the frames after the first one say against a flight: those of points that are
/// seen there and whose start is known.
bool counts(const Observation& observation, std::size_t k) {
  return !std::isnan(observation.positions(1)[k]) &&
         !(observation.tracked() &&
           std::isnan(observation.tracers[k % observation.tracers.size()]));
}

/// The normal equations of the six numbers of a motion, or of the angular three, on the positions
/// of the points.
struct FlightEquations {
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
  double square = 0;      ///< m², of what is left
  std::size_t count = 0;  ///< of coordinates
};
FlightEquations equations(const Observation& observation, const Flight& flight, int first,
                          int frames, const RigidMotion& motion) {
  const auto numbers = static_cast<std::size_t>(3 * frames * observation.points());
  const double* seen = observation.positions(1);
  const std::vector<double> flown = flight.fly(motion);
  std::vector<std::vector<double>> moved;
  for (int k = first; k < 6; ++k) {
    RigidMotion other = motion;  // the response is linear but for the motion of the particles
    (k < 3 ? other.linear[k] : other.angular[k - 3]) += 1;
    moved.push_back(flight.fly(other));
  }
  const auto size = static_cast<Eigen::Index>(moved.size());
  FlightEquations e{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  Eigen::VectorXd slope(size);
  for (std::size_t k = 0; k < numbers; ++k) {
    if (!counts(observation, k)) continue;
    const double miss = seen[k] - flown[k];
    for (Eigen::Index i = 0; i < size; ++i) slope[i] = moved[i][k] - flown[k];
    e.normal += slope * slope.transpose();
    e.right += slope * miss;
    e.square += miss * miss;
    ++e.count;
  }
  return e;
}

/// Gauss–Newton: linear and angular velocity, or the latter alone.
void fit_motion(const Observation& observation, const Flight& flight, bool linear, int frames,
                RigidMotion& motion) {
  for (int iteration = 0; iteration < 3; ++iteration) {
    FlightEquations e = equations(observation, flight, linear ? 0 : 3, frames, motion);
    // A body that is a point or a line along an axis does not show its rotation about it.
    e.normal.diagonal().array() += 1e-12 * e.normal.trace() + 1e-300;
    const Eigen::VectorXd step = e.normal.ldlt().solve(e.right);
    if (linear) motion.linear += step.head<3>();
    motion.angular += step.tail<3>();
  }
}

/// Files may hold float32: what its rounding takes from a position in the unit cube.
constexpr double kRounding = 6e-8;

std::vector<double> spread_of(const Observation& observation, const Flight& flight, int frames,
                              const RigidMotion& motion) {
  const FlightEquations e = equations(observation, flight, 0, frames, motion);
  const auto count = static_cast<double>(std::max<std::size_t>(e.count, 1));
  const double noise = std::max(observed_noise(observation), kRounding), square = noise * noise;
  // Where a point starts is as noisy as where it is later, and all its frames share that error.
  const double allowed = 2 * kNoiseAllowance * kNoiseAllowance * square;
  const double beside = std::max(0.0, e.square / count - allowed);  // m²
  std::vector<double> spread(6);
  for (int k = 0; k < 6; ++k) {
    spread[k] =
        std::sqrt(((1 + frames) * square + count * beside) / std::max(e.normal(k, k), 1e-300));
  }
  return spread;
}

}  // namespace

Eigen::Isometry3d flight_pose(const ObservedSteps& steps, const kernels::GridSettings& grid,
                              const RigidMotion& motion, std::ptrdiff_t frame) {
  const double t = steps_to(steps, frame) * grid.dt, speed = motion.angular.norm();
  const Vector3d axis = speed > 0 ? Vector3d(motion.angular / speed) : Vector3d::UnitX();
  const Vector3d moved = t * motion.linear + fall(grid, steps, frame);
  return Eigen::Translation3d(motion.centre + moved) * Eigen::AngleAxisd(speed * t, axis) *
         Eigen::Translation3d(-motion.centre);
}

bool meets_by(const Observation& observation, std::ptrdiff_t frame) {
  return observation.time[frame] - observation.time[0] > observation.meeting;
}

bool reaches_wall(const Observation& observation, const ObservedSteps& steps,
                  const kernels::GridSettings& grid, const RigidMotion& motion,
                  std::ptrdiff_t frame) {
  if (meets_by(observation, frame)) return true;
  const Eigen::Isometry3d pose = flight_pose(steps, grid, motion, frame);
  const double low = grid.bound + 0.5, high = grid.n - grid.bound - 0.5;  // in cells
  const std::vector<double> start = observation.start();
  for (std::int64_t p = 0; p < observation.particles; ++p) {
    const Vector3d x = grid.n * (pose * Map<const Vector3d>(start.data() + 3 * p));
    if (!((x.array() >= low).all() && (x.array() < high).all())) return true;
  }
  return false;
}

bool is_complete(const Observation& observation) {
  return !observation.tracked() && observation.cloud == 0 &&
         std::none_of(observation.x.begin(), observation.x.end(),
                      [](double x) { return std::isnan(x); });
}

Vector3d centre_of_mass(const Observation& observation) {
  return centre_of(observation, observation.start().data());
}

Vector3d centre_of_mass(const Observation& observation, std::ptrdiff_t frame) {
  return centre_of(observation, observation.positions(frame));
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
  constexpr double kWhole = 0.01;  // of a step: what a time is rounded by
  std::ptrdiff_t divisor = 0;
  for (const double time : observation.time) {
    const double steps = (time - observation.time[0]) / observation.dt, whole = std::round(steps);
    const bool between = std::abs(steps - whole) > kWhole;
    result.step.push_back(static_cast<std::ptrdiff_t>(between ? std::floor(steps) : whole));
    result.fraction.push_back(between ? steps - std::floor(steps) : 0);
    divisor = std::gcd(divisor, result.step.back());
    if (between) divisor = std::gcd(divisor, result.step.back() + 1);
  }
  result.stride = std::max<std::ptrdiff_t>(divisor, 1);
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

Observation some_frames(const Observation& observation, const std::vector<std::int64_t>& frames) {
  Observation part = observation;
  part.frames = static_cast<std::int64_t>(frames.size());
  part.time.clear();
  part.x.clear();
  for (const std::int64_t f : frames) {
    part.time.push_back(observation.time[f]);
    part.x.insert(part.x.end(), observation.positions(f), observation.positions(f + 1));
  }
  return part;
}

Observation first_frames(const Observation& observation, std::ptrdiff_t frames) {
  Observation part = observation;
  part.frames = frames;
  part.time.resize(static_cast<std::size_t>(frames));
  part.x.resize(static_cast<std::size_t>(3 * frames * observation.points()));
  return part;
}

double observed_size(const Observation& observation) {
  const std::vector<double> start = observation.start();
  Vector3d low = Map<const Vector3d>(start.data()), high = low;
  for (std::int64_t p = 1; p < observation.particles; ++p) {
    const auto x = Map<const Vector3d>(start.data() + 3 * p);
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  return (high - low).maxCoeff();
}

RigidMotion observed_motion(const Observation& observation, const ObservedSteps& steps,
                            const kernels::GridSettings& grid, int frames) {
  frames = static_cast<int>(std::min<std::int64_t>(frames, observation.frames - 1));
  const bool complete = is_complete(observation);
  RigidMotion motion;
  motion.centre = centre_of_mass(observation);
  if (complete) {
    Vector3d moment = Vector3d::Zero();
    double weight = 0;
    for (int f = 1; f <= frames; ++f) {
      const double t = steps_to(steps, f) * grid.dt;
      moment += t * (centre_of_mass(observation, f) - motion.centre - fall(grid, steps, f));
      weight += t * t;
    }
    motion.linear = moment / weight;
  }
  fit_motion(observation, Flight(observation, steps, grid, frames), !complete, frames, motion);
  return motion;
}

InitialState observed_motion(const Observation& observation, const ObservedSteps& steps,
                             const kernels::GridSettings& grid) {
  return estimate_motion(observation, steps, grid).motion;
}

MotionEstimate estimate_motion(const Observation& observation, const ObservedSteps& steps,
                               const kernels::GridSettings& grid) {
  if (observation.start_degree > 0) return estimate_deformed_start(observation);
  if (observation.cloud > 0) return estimate_cloud_motion(observation, steps, grid);
  int frames = 1;
  RigidMotion motion = observed_motion(observation, steps, grid, frames);
  if (observed_noise(observation) > kLittleNoise * observed_size(observation)) {
    // Noise may show as a fast rotation: look again with the better motion.
    for (int before = 0; frames > before;) {
      before = frames;
      while (frames + 1 < observation.frames &&
             steps_to(steps, frames + 1) * grid.dt * motion.angular.norm() < kFlightAngle &&
             !reaches_wall(observation, steps, grid, motion, frames + 1)) {
        ++frames;
      }
      if (frames > before) motion = observed_motion(observation, steps, grid, frames);
    }
  }
  std::vector<double> spread =
      spread_of(observation, Flight(observation, steps, grid, frames), frames, motion);
  if (meets_by(observation, frames)) {
    // What the other one does to it may pass for a motion of its own: as much as it moves.
    const double speed = motion.linear.norm(), size = observed_size(observation);
    for (int k = 0; k < 6; ++k) spread[k] += k < 3 ? speed : speed / size;
  }
  return {InitialState(motion), std::move(spread)};
}

std::ptrdiff_t first_contact(const Observation& observation, const ObservedSteps& steps,
                             const kernels::GridSettings& grid, const RigidMotion& motion) {
  if (observation.start_degree > 0) return 0;
  const bool complete = is_complete(observation);
  if (complete && flies_freely(observation, steps, grid)) return observation.frames;
  for (std::ptrdiff_t f = 1; f < observation.frames; ++f) {
    if (!complete) {
      if (reaches_wall(observation, steps, grid, motion, f)) return f;
      continue;
    }
    const double t = steps_to(steps, f) * grid.dt;
    const Vector3d free = motion.centre + t * motion.linear + fall(grid, steps, f);
    if ((centre_of_mass(observation, f) - free).norm() > kContactCells * grid.dx()) return f;
  }
  return observation.frames;
}

}  // namespace uniphy
