#pragma once

#include <cstdint>

#include "uniphy/io/observation.hpp"

namespace uniphy {

/// What a laboratory sees of a motion that is known in full.
struct LaboratoryView {
  double share = 1;        ///< of the points that is tracked, drawn from the seed, (0, 1]
  std::int64_t first = 0;  ///< frame that begins the observation, at which the body may be deformed
  std::int64_t stride = 1;  ///< of the frames, the first one is kept
  std::int64_t last = -1;   ///< frame that ends the observation; −1: the last one
  double noise = 0;         ///< standard deviation of a coordinate over the size of the body
  double hidden = 0;        ///< share of the positions that are hidden, [0, 1)
  /// Points of a cloud without correspondence: other particles, in any order, in every frame, drawn
  /// without putting back. 0: tracked points. Above 0 `share` is 1 and `hidden` 0.
  std::int64_t cloud = 0;
  bool says_noise = true;  ///< the observation tells its noise
  std::uint64_t seed = 1;
};

/// Where all particles are seen in all frames, they are the points still (version 1). Else the
/// points are tracers or clouds, and the body stands beside them as the first frame seen has it,
/// free of noise. A body that is a surface, or whose points are tracers, is not known at a later
/// frame. Positions that noise drives out of the unit cube stay on its side. Throws Error where
/// fewer than two frames or no point is left, where a cloud asks for more points than there are or
/// comes with a setting of tracked points, and where the motion is one of clouds already.
Observation laboratory_view(const Observation& whole, const LaboratoryView& view);

}  // namespace uniphy
