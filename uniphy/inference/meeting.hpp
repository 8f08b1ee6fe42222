#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy {

/// Where the particles of a body are at the frames of an observation.
struct BodyPath {
  std::int64_t frames = 0;
  std::vector<double> x;  ///< [frames, particles, 3] m
};

/// The first frame at which two bodies are so near that they share nodes of the grid, or would
/// within half a cell more; −1: they never do.
std::int64_t first_meeting(const BodyPath& a, const BodyPath& b, const kernels::GridSettings& grid);

/// For each body the number of the group that it belongs to: bodies that meet, in any order, are in
/// one group. `meets` [bodies, bodies] is symmetric.
std::vector<int> meeting_groups(const std::vector<std::vector<bool>>& meets);

}  // namespace uniphy
