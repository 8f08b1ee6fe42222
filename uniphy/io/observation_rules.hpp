#pragma once

#include <functional>
#include <string>

#include "uniphy/io/observation.hpp"

namespace uniphy {

/// Throws, naming the file; `object` is a dataset or an attribute.
using Failure = std::function<void(const std::string& object, const std::string& message)>;

/// Whether the body stands beside the points, in /body.
bool has_body_group(const Observation& observation);

/// What has to hold of an observation whether it is written or read: calls `fail` for the first
/// thing that does not.
void check_observation_rules(const Observation& observation, const Failure& fail);

}  // namespace uniphy
