#pragma once

#include <string>
#include <vector>

#include "uniphy/config/config.hpp"
#include "uniphy/scene/law_config.hpp"
#include "uniphy/scene/scene.hpp"
#include "uniphy/scene/shape_config.hpp"

namespace uniphy {

/// A scene as a configuration describes it, before any file that it names is opened.
class SceneSource {
 public:
  /// Opens meshes, particles, models and latents. Throws Error naming the body.
  SceneDescription load() const;
  std::vector<std::string> body_names() const;

 private:
  friend SceneSource read_scene(Section& config, bool with_laws);
  struct BodySource {
    BodyDescription description;
    ShapeLoader shape;
    LawSource law;
  };
  SceneDescription settings_;
  std::vector<BodySource> bodies_;
  bool with_laws_ = true;
};

/// Declares and reads the section `scene` (grid, time, gravity, walls, precision) and the list
/// `bodies`. Without `with_laws` the bodies' laws may be absent and are not used.
SceneSource read_scene(Section& config, bool with_laws = true);

/// The section `scene` alone.
SceneDescription read_scene_settings(Section& scene);

}  // namespace uniphy
