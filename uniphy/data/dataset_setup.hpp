#pragma once

#include <cstdint>

#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// The scene behind a trajectory of a data set, drawn again from the configuration that the file
/// carries: what is needed to simulate it once more, with its own law or another. Throws Error
/// where the data set does not come from uniphy_generate, where this version draws another
/// material, or where the trajectory is one of a law drawn at random.
TrajectorySetup setup_of(const Dataset& dataset, std::int64_t trajectory);

}  // namespace uniphy
