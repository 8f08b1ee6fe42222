#pragma once

#include <optional>
#include <string>
#include <vector>

#include "uniphy/evaluation/outside_options.hpp"
#include "uniphy/io/observation.hpp"
#include "uniphy/scene/scene.hpp"

namespace uniphy {

/// A scene of one body that any law can move.
struct OutsideScene {
  std::string name;  ///< "cube", "object_1", ...
  SceneDescription scene;
};

/// The benchmark scene of the field (P. Ma et al., ICML 2023) and objects drawn as those of a data
/// set are (heldout_all), thrown at a wall.
std::vector<OutsideScene> outside_scenes(const OutsideOptions& options);

/// What is seen of the scene where the law moves its body. Throws Error where the simulation fails.
Observation observe(const OutsideScene& scene, const kernels::LawDescription& law);

}  // namespace uniphy
