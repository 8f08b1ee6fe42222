#include "uniphy/scene/scene_config.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/physical_limits.hpp"

namespace uniphy {
namespace {

Eigen::Vector3d vector3(Section& section, const std::string& key, std::array<double, 3> fallback,
                        const std::string& unit, const std::string& doc) {
  const std::array<double, 3> value = section.vector3(key, fallback, any_number(), unit, doc);
  return {value[0], value[1], value[2]};
}

BodyDescription read_body(Section& section, std::size_t number) {
  BodyDescription body;
  body.name = section.text("name", fmt::format("body{}", number), "how messages call the body");
  body.placement.centre = vector3(section, "center", {0.5, 0.5, 0.5}, "m",
                                  "where the centre of the shape's bounding box stands");
  body.placement.rotation = euler_rotation(
      vector3(section, "rotation", {0, 0, 0}, "deg", "about x, then y, then z, fixed in space"));
  body.placement.size =
      section
          .real_or("none", "size", std::optional<double>(0.3), positive(), "m",
                   "largest side of the bounding box; none: the shape's own numbers are metres")
          .value_or(0);
  body.on_floor = section.boolean(
      "on_floor", false,
      "the body stands on the wall that gravity points at; center does not count along gravity");
  body.density = section.real("density", 1000, between(kLeastDensity, kLargestDensity), "kg/m^3",
                              "mass density");
  body.velocity = vector3(section, "velocity", {0, 0, 0}, "m/s", "at the start");
  body.angular_velocity =
      vector3(section, "angular_velocity", {0, 0, 0}, "rad/s", "at the start, about center");
  return body;
}

}  // namespace

SceneDescription read_scene_settings(Section& scene) {
  SceneDescription settings;
  settings.grid.n =
      static_cast<int>(scene.integer("grid", 20, between(8, 1024), "", "nodes a side"));
  settings.dt =
      scene.real_or("auto", "dt", std::optional<double>(), between(kLeastTimeStep, 1), "s",
                    "time step; auto: from sound speed, viscosity and speed. Results do not "
                    "settle as it shrinks: the transfer damps a little in every step");
  settings.safety = scene.real("safety", kTimeStepSafety, Range{0, 1, true, false}, "",
                               "share of the stable time step that auto takes");
  settings.steps = scene.integer("steps", 1000, between(0, 1e9), "", "number of time steps");
  settings.duration = scene.real_or("none", "duration", std::optional<double>(), at_least(0), "s",
                                    "simulated time, in place of steps");
  scene.one_of("duration", "steps");
  settings.frame_stride =
      scene.integer("frame_stride", 5, between(1, 1e9), "", "steps from frame to frame");
  const std::array<double, 3> gravity = scene.vector3("gravity", std::array<double, 3>{0, -9.8, 0},
                                                      between(-kLargestGravity, kLargestGravity),
                                                      "m/s^2", "acceleration of everything");
  std::copy(gravity.begin(), gravity.end(), settings.grid.gravity);
  const std::string walls =
      scene.choice("walls", std::string("freeslip"), {"freeslip", "noslip"},
                   "what the walls stop: motion into them, or all motion that leads into them");
  settings.grid.wall = walls == "noslip" ? kernels::Wall::noslip : kernels::Wall::freeslip;
  settings.grid.bound = static_cast<int>(scene.integer("bound", 3, between(1, 100), "",
                                                       "thickness of the walls in "
                                                       "nodes"));
  if (2 * settings.grid.bound >= settings.grid.n) {
    scene.fail("bound", fmt::format("expected less than half the grid of {}, found {}",
                                    settings.grid.n, settings.grid.bound));
  }
  settings.single_precision = scene.choice("dtype", std::string("float64"), {"float32", "float64"},
                                           "precision of the simulation") == "float32";
  return settings;
}

SceneSource read_scene(Section& config, bool with_laws) {
  SceneSource source;
  source.with_laws_ = with_laws;
  Section scene = config.section("scene", "the grid, the time and the walls");
  source.settings_ = read_scene_settings(scene);
  source.settings_.continued = scene.input_file("continue", std::string(),
                                                "trajectory.h5 of an earlier run of this scene, "
                                                "which goes on from its last state by steps or "
                                                "duration");
  for (Section& section : config.list("bodies", "what moves in the scene", at_least(1))) {
    SceneSource::BodySource body;
    body.description = read_body(section, source.bodies_.size());
    const auto taken = source.body_names();
    if (std::count(taken.begin(), taken.end(), body.description.name) > 0) {
      section.fail("name", fmt::format("expected a name of its own, found \"{}\" again",
                                       body.description.name));
    }
    Section shape = section.section("shape", "what the body looks like");
    body.shape = read_shape(shape);
    if (shape.says("in_place", "true")) {
      section.none_of({"center", "rotation", "size", "on_floor"}, "shape.in_place");
    }
    Section filling = section.section("filling", "the particles that it is made of");
    body.description.filling = read_filling(filling);
    if (with_laws) {
      Section law = section.section("law", "what the body is made of");
      body.law = read_law(law);
    } else if (auto law = section.optional_section("law", "not used: the fitted law replaces it")) {
      body.law = read_law(*law);
    }
    source.bodies_.push_back(std::move(body));
  }
  return source;
}

std::vector<std::string> SceneSource::body_names() const {
  std::vector<std::string> names;
  for (const BodySource& body : bodies_) names.push_back(body.description.name);
  return names;
}

SceneDescription SceneSource::load() const {
  SceneDescription scene = settings_;
  for (const BodySource& source : bodies_) {
    BodyDescription body = source.description;
    try {
      source.shape(&body);
      if (with_laws_) body.law = source.law.load(&body.law_origin);
    } catch (const Error& error) {
      throw Error(fmt::format("body \"{}\": {}", body.name, error.what()));
    }
    scene.bodies.push_back(std::move(body));
  }
  return scene;
}

}  // namespace uniphy
