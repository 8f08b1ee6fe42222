#pragma once

#include <cstdint>
#include <vector>

#include "uniphy/data/generate_options.hpp"
#include "uniphy/data/random_law.hpp"

namespace uniphy {

/// The simulated trajectories that states for laws of this kind are taken from.
std::vector<std::int64_t> bases_of(const GenerateOptions& options, RandomLawKind kind);

/// What a trajectory of a law drawn at random is made from.
struct RandomRow {
  RandomLawKind kind = RandomLawKind::solid;
  std::int64_t base = 0;   ///< a simulated trajectory, drawn from bases_of
  std::uint64_t seed = 0;  ///< of draw_random_law
};
/// Of trajectory options.simulated() … options.total() − 1. More laws of one kind leave those that
/// were there, and the other kinds, as they were.
RandomRow random_row(const GenerateOptions& options, std::int64_t trajectory);

}  // namespace uniphy
