#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "uniphy/inference/observed_motion.hpp"

namespace uniphy {

/// How far an observation is what a fit takes it for, from the positions alone: a body that is
/// undeformed at the first frame, moves as a rigid one there, and then meets a wall.
struct ObservationCheck {
  double size = 0;   ///< m, largest side at the first frame
  double noise = 0;  ///< m, standard deviation of a coordinate (observed_noise)

  /// Frames after the first, at most kStartFrames, at which no wall is within reach of the body and
  /// its rotation is small still. 0 where a wall is near from the start.
  std::ptrdiff_t free_frames = 0;
  /// m, the largest residual of the best rigid motion from the first frame to one of those (to the
  /// second frame where there are none): root of the mean square of a coordinate.
  double start_residual = 0;
  /// m, what noise and rotation explain of it, at the same frame.
  double start_allowed = 0;

  /// m²/s², the most that the energy of the centre of mass (of motion and height, a kilogram)
  /// exceeds that of the first frame, rotation included; negative where it never does. Nothing but
  /// a deformation that was there at the first frame can give it: walls do no work.
  double energy_gain = 0;
  double kinetic = 0;         ///< m²/s², the largest kinetic energy of the centre of mass
  double energy_allowed = 0;  ///< m²/s², what noise and the time stepping explain of the gain

  bool start_is_rigid() const {
    return (free_frames == 0 || start_residual <= start_allowed) && energy_gain <= energy_allowed;
  }
};

/// By the motion of the first frames (observed_motion).
ObservationCheck check_observation(const Observation& observation, const ObservedSteps& steps,
                                   const kernels::GridSettings& grid);

/// Where start_is_rigid() does not hold, a sentence that says by how much.
std::optional<std::string> start_warning(const ObservationCheck& check);

/// Frames that start_residual looks at: enough for a wave to cross a part of a soft body (a cube of
/// 0.2 m and 5 kPa rings at 10 Hz; eight frames of 1/400 s are a fifth of that).
inline constexpr std::ptrdiff_t kStartFrames = 8;

}  // namespace uniphy
