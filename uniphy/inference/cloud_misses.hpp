#pragma once

#include <vector>

#include "uniphy/io/observation.hpp"

namespace uniphy {

/// How far a body is from the clouds of an observation (CloudComparison, all points), m.
struct CloudMisses {
  std::vector<double>
      root;  ///< [frames] root of the mean square of a coordinate; 0 of an empty one
  std::vector<double> largest;  ///< [frames] of one point
  double over_all = 0;          ///< root of the mean square over the frames that show a point
};
/// x [frames, particles, 3] m.
CloudMisses cloud_misses(const Observation& observation, const std::vector<double>& x);

/// What the body as it stands misses of the first cloud, m, root of the mean square of a
/// coordinate: the noise, and that a cloud is a sample. Half the spacing of the particles where the
/// first frame shows nothing.
double cloud_noise(const Observation& observation);

}  // namespace uniphy
