#include "uniphy/stability/stability_scenes.hpp"

#include <algorithm>
#include <cmath>

#include "uniphy/geometry/shape_catalogue.hpp"

namespace uniphy::stability {
namespace {

/// A cell of the grid of 20 nodes that all scenes have, and the plane of its walls (bound 3).
constexpr double kCell = 0.05, kWall = 0.1;
/// The side of the benchmark cube, which `per_side` counts particles along; smaller bodies have as
/// many to a cell.
constexpr double kBenchmarkSide = 0.5;

BodyDescription cube(const kernels::LawDescription& law, double size, std::int64_t per_side) {
  BodyDescription body;
  body.name = "cube";
  body.solid = make_shape("box");
  body.filling.kind = Filling::Kind::per_side;
  body.filling.count = std::max<std::int64_t>(
      2, std::llround(static_cast<double>(per_side) * size / kBenchmarkSide));
  body.placement.size = size;
  body.law = law;
  return body;
}

SceneDescription without_gravity(std::int64_t steps) {
  SceneDescription scene;
  scene.steps = steps;
  for (double& g : scene.grid.gravity) g = 0;
  return scene;
}

}  // namespace

SceneDescription cube_on_floor(const kernels::LawDescription& law, std::int64_t per_side,
                               std::int64_t steps, double size) {
  SceneDescription scene;
  scene.steps = steps;
  BodyDescription body = cube(law, size, per_side);
  body.velocity = {1, -1.5, -2};
  body.angular_velocity = {4, 4, 4};
  body.on_floor = true;
  scene.bodies.push_back(body);
  return scene;
}

SceneDescription thrown_at_wall(const kernels::LawDescription& law, double speed,
                                std::int64_t per_side, std::int64_t steps) {
  SceneDescription scene = without_gravity(steps);
  BodyDescription body = cube(law, 0.3, per_side);
  body.placement.centre = {0.5, kWall + kCell + 0.15, 0.5};
  body.velocity = {0, -speed, 0};
  scene.bodies.push_back(body);
  return scene;
}

SceneDescription thrown_into_corner(const kernels::LawDescription& law, double speed,
                                    std::int64_t per_side, std::int64_t steps) {
  SceneDescription scene = without_gravity(steps);
  BodyDescription body = cube(law, 0.3, per_side);
  body.placement.centre = Eigen::Vector3d::Constant(kWall + kCell + 0.15);
  body.velocity = Eigen::Vector3d::Constant(-speed / std::sqrt(3.0));
  scene.bodies.push_back(body);
  return scene;
}

SceneDescription two_cubes(const kernels::LawDescription& law, double speed, std::int64_t per_side,
                           std::int64_t steps) {
  SceneDescription scene = without_gravity(steps);
  // A cell of gap.
  const double away = 0.1 + 0.5 * kCell;
  for (const double side : {-1.0, 1.0}) {
    BodyDescription body = cube(law, 0.2, per_side);
    body.name = side < 0 ? "left" : "right";
    body.placement.centre = {0.5 + side * away, 0.5, 0.5};
    body.velocity = {-side * 0.5 * speed, 0, 0};
    scene.bodies.push_back(body);
  }
  return scene;
}

SceneDescription pushed_at_wall(const kernels::LawDescription& law, double pull,
                                std::int64_t per_side, std::int64_t steps) {
  SceneDescription scene = without_gravity(steps);
  scene.grid.gravity[0] = -pull;
  BodyDescription body = cube(law, 0.3, per_side);
  body.placement.centre = {kWall + kCell + 0.15, 0.5, 0.5};
  scene.bodies.push_back(body);
  return scene;
}

SceneDescription free_flight(const kernels::LawDescription& law, double density,
                             std::int64_t per_side, std::int64_t steps) {
  SceneDescription scene = without_gravity(steps);
  BodyDescription body = cube(law, 0.3, per_side);
  body.density = density;
  body.velocity = {0.5, 0, 0};
  scene.bodies.push_back(body);
  return scene;
}

}  // namespace uniphy::stability
