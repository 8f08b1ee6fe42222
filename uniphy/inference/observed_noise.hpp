#pragma once

#include <cstdint>
#include <vector>

#include "uniphy/io/observation.hpp"

namespace uniphy {

/// Standard deviation of the noise of a coordinate of the paths c [frames, points, 3] at `time`
/// [frames] (s), in the unit of c: the median of third divided differences in time, which a smooth
/// motion has next to none of. 0 with less than four frames. NaN is passed over.
double path_noise(const std::vector<double>& time, const double* c, std::int64_t points);

/// Of the observed positions, m: what the observation says, else the estimate. Of clouds, what a
/// cloud leaves of the body in its right place (cloud_noise).
double observed_noise(const Observation& observation);

}  // namespace uniphy
