#pragma once

#include <string>
#include <vector>

#include "ops/kernels/mpm/grid.hpp"
#include "uniphy/inference/rigid_motion.hpp"
#include "uniphy/io/observation.hpp"

namespace uniphy {

/// The frames of an observation as states of a simulation.
struct ObservedSteps {
  std::vector<std::ptrdiff_t> step;  ///< [frames] MPM steps from the first frame, which is 0
  std::ptrdiff_t stride = 1;         ///< largest number that divides all of them

  std::ptrdiff_t last(std::ptrdiff_t frames) const { return step[frames - 1]; }
};

/// Throws Error, starting with `name`, where a time is not a multiple of dt to 1 % of dt.
ObservedSteps observed_steps(const Observation& observation, const std::string& name);

/// The grid, walls, gravity and dt of the observation. Throws Error where they make no sense.
kernels::GridSettings observed_grid(const Observation& observation, const std::string& name);

/// kg of each particle: density × volume.
std::vector<double> observed_mass(const Observation& observation);

/// Of the particles at a frame, m.
Eigen::Vector3d centre_of_mass(const Observation& observation, std::ptrdiff_t frame);

/// The first `frames` of an observation.
Observation first_frames(const Observation& observation, std::ptrdiff_t frames);

/// Largest side of the box round the particles at the first frame, m.
double observed_size(const Observation& observation);

/// The velocity of the body at the first frame, from observed positions alone. The body is taken to
/// fly freely and to move as a rigid one at the first frame; `frames` frames after it are used:
/// - linear: the centre of mass moves as x₀ + k Δt v + ½ k (k+1) Δt² g whatever the material,
///   because internal forces cancel; least squares over the frames.
/// - angular: Gauss–Newton on the positions that the simulation itself gives without stress, since
///   the first transfer to the grid and back (C = 0) takes away a part of the rotation that depends
///   on grid and shape. Stress moves particles by O(t²) along the radius only.
/// Frames should be close: |ω| times the time they span ought to be small against 1.
RigidMotion observed_motion(const Observation& observation, const ObservedSteps& steps,
                            const kernels::GridSettings& grid, int frames);

/// The first frame at which the centre of mass has left the parabola of free flight by more than
/// 1 % of a cell: a wall acts. The number of frames where that never happens, or where another
/// parabola explains all frames (the motion of the first ones is noisy).
std::ptrdiff_t first_contact(const Observation& observation, const ObservedSteps& steps,
                             const kernels::GridSettings& grid, const RigidMotion& motion);

}  // namespace uniphy
