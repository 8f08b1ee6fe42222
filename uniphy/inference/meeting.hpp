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

/// The first frame at which two bodies are so near that they share nodes of the grid; −1: they
/// never do. What one does to the other may begin any time after the frame before.
std::int64_t first_meeting(const BodyPath& a, const BodyPath& b, const kernels::GridSettings& grid);

/// For each body the number of the group that it belongs to: bodies that meet, in any order, are in
/// one group. `meets` [bodies, bodies] is symmetric.
std::vector<int> meeting_groups(const std::vector<std::vector<bool>>& meets);

}  // namespace uniphy
