#pragma once

#include "uniphy/inference/observed_motion.hpp"

namespace uniphy {

/// The velocity of a body that is deformed at the first frame and may touch walls there, from
/// observed positions alone: polynomials of Observation::start_degree in the place, for the
/// velocity and the acceleration, fitted by least squares to how far every point has moved over the
/// first frames, as many as the noise asks for. The stretch is not known from them: it is 0 with a
/// spread of kStretchSpread.
MotionEstimate estimate_deformed_start(const Observation& observation);

/// Of a coefficient of the logarithm of the stretch.
inline constexpr double kStretchSpread = 0.1;

}  // namespace uniphy
