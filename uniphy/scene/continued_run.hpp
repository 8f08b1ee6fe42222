#pragma once

#include <filesystem>
#include <string>

#include "uniphy/scene/scene.hpp"

namespace uniphy {

/// Hash of all that decides the bits of a step and is not in the particles' state: grid, dt,
/// gravity, walls, precision, masses, volumes, bodies and their laws with the weights of networks.
std::string scene_hash(const SceneDescription& scene, const PlacedScene& placed);

/// Lets a placed scene go on from the last state in `file`, to the bits that the run of `file`
/// would have had with more steps. `yaml` is the configuration of this run. Throws Error naming the
/// first key that differs from the configuration in the file (how long the run is and how often it
/// stores frames may), or where masses, volumes or laws are others: a run cannot go on as another.
void continue_run(const std::filesystem::path& file, const std::string& yaml,
                  const SceneDescription& scene, PlacedScene* placed);

}  // namespace uniphy
