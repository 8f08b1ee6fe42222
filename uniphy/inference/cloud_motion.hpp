#pragma once

#include "uniphy/inference/observed_motion.hpp"

namespace uniphy {

/// The velocity of the body at the first frame from clouds without correspondence: the linear one
/// from the path of their centres over the frames before the body reaches a wall, then both by
/// LevenbergMarquardt on how a rigid body in free flight fits them (CloudComparison). The spread is
/// that of one independent error a frame, of the size of what is left there.
MotionEstimate estimate_cloud_motion(const Observation& observation, const ObservedSteps& steps,
                                     const kernels::GridSettings& grid);

}  // namespace uniphy
