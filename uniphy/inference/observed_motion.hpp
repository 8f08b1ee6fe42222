#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "ops/kernels/mpm/grid.hpp"
#include "uniphy/inference/initial_state.hpp"
#include "uniphy/io/observation.hpp"

namespace uniphy {

/// The frames of an observation in steps of a simulation.
struct ObservedSteps {
  std::vector<std::ptrdiff_t> step;  ///< [frames] whole MPM steps from the first frame, which is 0
  std::vector<double> fraction;      ///< [frames] of a step after that, [0, 1)
  std::ptrdiff_t stride = 1;  ///< largest number that divides all steps that a frame is taken from

  /// The step at which all of the first `frames` are known.
  std::ptrdiff_t last(std::ptrdiff_t frames) const {
    return step[frames - 1] + (fraction[frames - 1] > 0 ? 1 : 0);
  }
};

/// A time within 1 % of dt of a whole step counts as one. Throws Error, starting with `name`, where
/// the frames span too many steps.
ObservedSteps observed_steps(const Observation& observation, const std::string& name);

/// The grid, walls, gravity and dt of the observation. Throws Error where they make no sense.
kernels::GridSettings observed_grid(const Observation& observation, const std::string& name);

/// kg of each particle: density × volume.
std::vector<double> observed_mass(const Observation& observation);

/// Whether the points are the particles and all of them are seen in every frame.
bool is_complete(const Observation& observation);

/// Of the body at the first frame, m.
Eigen::Vector3d centre_of_mass(const Observation& observation);
/// Of a complete observation at a frame, m.
Eigen::Vector3d centre_of_mass(const Observation& observation, std::ptrdiff_t frame);

/// The frames with those numbers.
Observation some_frames(const Observation& observation, const std::vector<std::int64_t>& frames);
/// The first `frames` of an observation.
Observation first_frames(const Observation& observation, std::ptrdiff_t frames);

/// Largest side of the box round the particles at the first frame, m.
double observed_size(const Observation& observation);

/// The velocity of the body at the first frame, from observed positions alone. The body is taken to
/// fly freely and to move as a rigid one at the first frame; `frames` frames after it are used:
/// Gauss–Newton on the positions that the simulation itself gives without stress, since the first
/// transfer to the grid and back (C = 0) takes away a part of the rotation that depends on grid and
/// shape. Stress moves particles by O(t²) along the radius only. Of a complete observation the
/// linear part follows from the centre of mass, which moves as x₀ + k Δt v + ½ k (k+1) Δt² g
/// whatever the material, because internal forces cancel; least squares over the frames. Frames
/// should be close: |ω| times the time they span ought to be small against 1.
RigidMotion observed_motion(const Observation& observation, const ObservedSteps& steps,
                            const kernels::GridSettings& grid, int frames);

/// The same from as many frames as the noise asks for: one where there is next to none, else those
/// before the body reaches a wall and before it has turned by kFlightAngle. Of a body that is
/// deformed there, see estimate_deformed_start; of clouds, see estimate_cloud_motion.
InitialState observed_motion(const Observation& observation, const ObservedSteps& steps,
                             const kernels::GridSettings& grid);

/// That motion and how well it is known.
struct MotionEstimate {
  InitialState motion;
  /// [initial_numbers] standard deviations of its numbers, as in numbers_of: of the noise as of
  /// errors that the frames of a point share (its start) and that points do not, and of what free
  /// flight leaves beside it as of one error that all points share.
  std::vector<double> spread;
};
MotionEstimate estimate_motion(const Observation& observation, const ObservedSteps& steps,
                               const kernels::GridSettings& grid);
/// rad. The rotation of a body without stress, which the positions are compared with, is off by
/// ½ kFlightAngle² of a radius at its end.
inline constexpr double kFlightAngle = 0.2;

/// Where a rigid body in free flight is at a frame: its pose there over that at the first one.
Eigen::Isometry3d flight_pose(const ObservedSteps& steps, const kernels::GridSettings& grid,
                              const RigidMotion& motion, std::ptrdiff_t frame);

/// Whether another body may have acted on this one until the frame (Observation::meeting).
bool meets_by(const Observation& observation, std::ptrdiff_t frame);

/// Whether the body, moving on as a rigid one, reads a node that a wall stops at the frame, or
/// meets_by() it.
bool reaches_wall(const Observation& observation, const ObservedSteps& steps,
                  const kernels::GridSettings& grid, const RigidMotion& motion,
                  std::ptrdiff_t frame);

/// The first frame at which a wall or another body acts; the number of frames where that never
/// happens. Of a complete observation it is where the centre of mass has left the parabola of free
/// flight by more than 1 % of a cell, unless another parabola explains all frames (the motion of
/// the first ones is noisy). Else it is where the body, flying on as a rigid one, is the first time
/// so near a wall that it reads its nodes. Of a body that is deformed at the first frame it is that
/// one: stress acts from there on.
std::ptrdiff_t first_contact(const Observation& observation, const ObservedSteps& steps,
                             const kernels::GridSettings& grid, const RigidMotion& motion);

}  // namespace uniphy
