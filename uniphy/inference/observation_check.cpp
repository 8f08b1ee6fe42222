#include "uniphy/inference/observation_check.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <vector>

#include "uniphy/inference/observed_noise.hpp"

namespace uniphy {
namespace {

using Eigen::Map;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Largest angle (rad) that the body has turned by at the last frame that is looked at.
constexpr double kSmallAngle = 0.2;
/// Residual over size that is no matter: an initial strain of a ten-thousandth, or rounding.
constexpr double kSmallResidual = 1e-4;
/// Part of the turning by a cell that the first transfer to the grid and back changes: boxes of 0.3
/// m that turn at 4 to 28 rad/s left residuals of up to 0.1 of it.
constexpr double kTransferShare = 0.25;
/// Residual over the mean that noise leaves. Of 64 particles the root scatters by 5 %.
constexpr double kNoiseMargin = 1.5;
/// Part of the kinetic energy that a gain has to exceed: a centre of mass that is seen at a few
/// instants has other speeds than it had between them.
constexpr double kEnergyMargin = 0.1;

Map<const Vector3d> at(const Observation& o, std::ptrdiff_t frame, std::int64_t particle) {
  return Map<const Vector3d>(o.positions(frame) + 3 * particle);
}

/// True where no particle of the frame reads a node that a wall stops.
bool out_of_reach(const Observation& o, const kernels::GridSettings& grid, std::ptrdiff_t frame) {
  const double low = grid.bound + 0.5, high = grid.n - grid.bound - 0.5;  // in cells
  const double* x = o.positions(frame);
  return std::all_of(x, x + 3 * o.points(), [&](double c) {
    return std::isnan(c) || (c * grid.n >= low && c * grid.n < high);
  });
}

/// Root of the mean square, over the points that both show and coordinates, of what the best
/// rotation and translation leave between the first frame and another. W. Kabsch, Acta Cryst. A32
/// (1976). Particles count by their volume.
double rigid_residual(const Observation& o, std::ptrdiff_t frame) {
  std::vector<std::int64_t> both;
  for (std::int64_t p = 0; p < o.points(); ++p) {
    if (o.is_seen(0, p) && o.is_seen(frame, p)) both.push_back(p);
  }
  if (both.empty()) return 0;
  const auto weight = [&](std::int64_t p) { return o.tracked() ? 1.0 : o.volume[p]; };
  Vector3d from = Vector3d::Zero(), to = Vector3d::Zero();
  double total = 0;
  for (const std::int64_t p : both) {
    from += weight(p) * at(o, 0, p);
    to += weight(p) * at(o, frame, p);
    total += weight(p);
  }
  from /= total;
  to /= total;
  Matrix3d moment = Matrix3d::Zero();
  for (const std::int64_t p : both)
    moment += weight(p) * (at(o, frame, p) - to) * (at(o, 0, p) - from).transpose();
  const Eigen::JacobiSVD<Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d flip = Matrix3d::Identity();
  flip(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Matrix3d R = svd.matrixU() * flip * svd.matrixV().transpose();
  double sum = 0;
  for (const std::int64_t p : both)
    sum += weight(p) * (at(o, frame, p) - to - R * (at(o, 0, p) - from)).squaredNorm();
  return std::sqrt(sum / (3 * total));
}

/// Σ m |ω × (x − centre)|² / Σ m at the first frame.
double square_of_turning(const Observation& o, const RigidMotion& motion) {
  const std::vector<double> start = o.start();
  double sum = 0, total = 0;
  for (std::int64_t p = 0; p < o.particles; ++p) {
    const Map<const Vector3d> x(start.data() + 3 * p);
    sum += o.volume[p] * motion.angular.cross(x - motion.centre).squaredNorm();
    total += o.volume[p];
  }
  return sum / total;
}

void check_start(const Observation& o, const ObservedSteps& steps,
                 const kernels::GridSettings& grid, const RigidMotion& motion,
                 ObservationCheck& check) {
  const double turning = motion.angular.norm();
  const auto angle = [&](std::ptrdiff_t f) {
    return turning * static_cast<double>(steps.step[f]) * grid.dt;
  };
  const std::ptrdiff_t most = std::min<std::ptrdiff_t>(kStartFrames, o.frames - 1);
  while (check.free_frames < most && !meets_by(o, check.free_frames + 1) &&
         out_of_reach(o, grid, check.free_frames) && out_of_reach(o, grid, check.free_frames + 1) &&
         (check.free_frames == 0 || angle(check.free_frames + 1) < kSmallAngle)) {
    ++check.free_frames;
  }
  // A spinning body without stress flies apart along tangents, which is ½ (ωt)² r outwards; one
  // with stress ends up between that and a rotation. The first transfer to the grid and back takes
  // the more of the rotation the nearer a particle is to the surface: a part of ωt Δx.
  const double arm = turning > 0 ? std::sqrt(square_of_turning(o, motion)) / turning : 0;
  double worst = -1;
  for (std::ptrdiff_t f = 1; f <= std::max<std::ptrdiff_t>(check.free_frames, 1); ++f) {
    const double residual = rigid_residual(o, f);
    const double spin =
        (0.5 * angle(f) * angle(f) * arm + kTransferShare * angle(f) * grid.dx()) / std::sqrt(3.0);
    const double allowed =
        kNoiseMargin * std::sqrt(2.0) * check.noise + spin + kSmallResidual * check.size;
    if (residual - allowed > worst || f == 1) {
      worst = residual - allowed;
      check.start_residual = residual;
      check.start_allowed = allowed;
    }
  }
}

void check_energy(const Observation& o, const kernels::GridSettings& grid,
                  const RigidMotion& motion, ObservationCheck& check) {
  std::vector<double> path;
  for (std::int64_t f = 0; f < o.frames; ++f) {
    const Vector3d c = centre_of_mass(o, f) - motion.centre;
    path.insert(path.end(), c.data(), c.data() + 3);
  }
  const double noise = std::min(path_noise(o.time, path.data(), 1), check.noise);
  const Map<const Vector3d> gravity(grid.gravity);
  const double first = 0.5 * (motion.linear.squaredNorm() + square_of_turning(o, motion));
  double shortest = o.time[1] - o.time[0];
  check.kinetic = 0.5 * motion.linear.squaredNorm();
  for (std::int64_t f = 1; f < o.frames; ++f) {
    const Map<const Vector3d> before(path.data() + 3 * (f - 1)), now(path.data() + 3 * f);
    const double t = o.time[f] - o.time[f - 1];
    shortest = std::min(shortest, t);
    const double kinetic = 0.5 * ((now - before) / t).squaredNorm();
    const double gain = kinetic - 0.5 * gravity.dot(now + before) - first;
    check.kinetic = std::max(check.kinetic, kinetic);
    check.energy_gain = f == 1 ? gain : std::max(check.energy_gain, gain);
  }
  // Both speeds are differences of two noisy positions; the largest of many is looked at.
  const double speed_noise = 4 * std::sqrt(2.0) * noise / shortest;
  check.energy_allowed = kEnergyMargin * check.kinetic +
                         2 * std::sqrt(2 * check.kinetic) * speed_noise + speed_noise * speed_noise;
}

}  // namespace

ObservationCheck check_observation(const Observation& observation, const ObservedSteps& steps,
                                   const kernels::GridSettings& grid) {
  ObservationCheck check;
  check.size = observed_size(observation);
  check.noise = observed_noise(observation);
  // One is not taken for rigid, the other does not show whether it is.
  if (observation.start_degree > 0 || observation.cloud > 0) return check;
  const RigidMotion motion = observed_motion(observation, steps, grid);
  check_start(observation, steps, grid, motion, check);
  // Another body may push it.
  if (is_complete(observation) && !meets_by(observation, observation.frames - 1))
    check_energy(observation, grid, motion, check);
  return check;
}

std::optional<std::string> start_warning(const ObservationCheck& check) {
  if (check.start_is_rigid()) return {};
  std::string seen;
  if (check.energy_gain > check.energy_allowed) {
    seen = fmt::format(
        "its centre of mass gains {:.2g} J/kg of {:.2g} J/kg after it, where noise explains {:.2g}",
        check.energy_gain, check.kinetic, check.energy_allowed);
  }
  if (check.free_frames > 0 && check.start_residual > check.start_allowed) {
    if (!seen.empty()) seen += "; ";
    seen += fmt::format(
        "away from the walls the best rigid motion leaves {:.2g} % of the size over the first {} "
        "frames, where noise and rotation explain {:.2g} %",
        100 * check.start_residual / check.size, check.free_frames,
        100 * check.start_allowed / check.size);
  }
  return fmt::format(
      "the first frame is taken as undeformed and its motion as rigid, and it is not: {}; expected "
      "an observation that begins before the body is deformed, or start_degree 1 to 3, which fits "
      "how it is",
      seen);
}

}  // namespace uniphy
