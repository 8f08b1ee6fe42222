#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/geometry/solid.hpp"

namespace uniphy {

/// The names of the shapes given by signed distance, in alphabetical order.
const std::vector<std::string>& shape_names();

/// A shape with its default proportions: about one unit large and standing on or round the origin.
/// Where a shape is drawn at random (blobby) `seed` decides. Throws Error that lists the names.
SolidPtr make_shape(const std::string& name, std::uint64_t seed = 1);

}  // namespace uniphy
