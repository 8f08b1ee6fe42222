#include "uniphy/evaluation/outside_scenes.hpp"

#include <fmt/format.h>

#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"

namespace uniphy {
namespace {

constexpr std::int64_t kFrameStride = 5;  ///< steps

OutsideScene benchmark_cube(const OutsideOptions& o) {
  OutsideScene cube{"cube", {}};
  cube.scene.steps = o.steps;
  BodyDescription body;
  body.name = "cube";
  body.solid = make_shape("box");
  body.filling.kind = Filling::Kind::per_side;
  body.filling.count = o.per_side;
  body.placement.size = 0.5;
  body.velocity = {1, -1.5, -2};
  body.angular_velocity = {4, 4, 4};
  cube.scene.bodies.push_back(body);
  return cube;
}

/// Draws shapes and motions; the law is a stand-in of a soft solid, whose wave speed allows all
/// speeds asked for.
GenerateOptions drawn_objects(const OutsideOptions& o) {
  GenerateOptions draw;
  draw.seed = o.seed;
  draw.split = Split::heldout_all;
  draw.trajectories = o.objects;
  draw.materials = {{kernels::LawId::elastic, {{{1e5, 1e5}, {2e5, 2e5}}}}};
  draw.steps = o.steps;
  draw.dt = o.dt;
  draw.particles = o.particles;
  draw.heldout_shapes = {"blobby", "dodecahedron", "gear", "knurling",
                         "pawn",   "rounded_cone", "toy"};
  // As the hidden objects of uniphy_identify: they meet a wall at once.
  draw.size = {0.22, 0.32};
  draw.speed = {1, 4};
  draw.gap = {0.01, 0.06};
  draw.angular_speed = {0, 8};
  return draw;
}

}  // namespace

std::vector<OutsideScene> outside_scenes(const OutsideOptions& o) {
  std::vector<OutsideScene> scenes{benchmark_cube(o)};
  const GenerateOptions draw = drawn_objects(o);
  for (std::int64_t i = 0; i < o.objects; ++i)
    scenes.push_back({fmt::format("object_{}", i + 1), draw_setup(draw, i, 0).scene});
  for (OutsideScene& s : scenes) {
    s.scene.dt = o.dt;
    s.scene.frame_stride = kFrameStride;
  }
  return scenes;
}

Observation observe(const OutsideScene& scene, const kernels::LawDescription& law) {
  SceneDescription moved = scene.scene;
  moved.bodies.front().law = law;
  const PlacedScene placed = place_scene(moved);
  Observation seen = begin_observation(placed.grid, moved.bodies.front().density, placed.volume);
  run_scene(moved, placed, {}, [&](double time, std::int64_t, const ParticleState& state) {
    add_frame(seen, time, state.x);
    return true;
  });
  return seen;
}

}  // namespace uniphy
