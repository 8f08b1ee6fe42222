#include "uniphy/scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/scene/overlap.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

constexpr const char* kAxes[3] = {"x", "y", "z"};

void check_settings(const SceneDescription& scene) {
  if (scene.bodies.empty()) throw Error("scene: expected at least one body, found none");
  if (scene.steps < 0 || scene.frame_stride < 1) {
    throw Error(fmt::format("scene: expected steps >= 0 and frame_stride >= 1, found {} and {}",
                            scene.steps, scene.frame_stride));
  }
  if (scene.dt && !(std::isfinite(*scene.dt) && *scene.dt > 0)) {
    throw Error(fmt::format("scene: dt: expected a positive number, found {}", *scene.dt));
  }
}

// A placed body keeps clear of the nodes whose velocity the walls clamp; particles given in place
// (a state of an earlier run, say) may lean on the walls and only have to stay on the grid.
void check_extent(const BodyDescription& body, const BodyParticles& particles,
                  const kernels::GridSettings& grid) {
  const Bounds bounds = bounds_of(particles.x);
  const double dx = grid.dx();
  const double low = body.in_place ? 0.5 * dx : std::max(1, grid.bound) * dx;
  const double high = body.in_place ? 1 - 1.5 * dx : 1 - low;
  for (int axis = 0; axis < 3; ++axis) {
    if (bounds.min[axis] >= low - 1e-12 && bounds.max[axis] <= high + 1e-12) continue;
    throw Error(fmt::format(
        "body \"{}\": spans {} from {:.6g} to {:.6g} m, expected within {:.6g} to {:.6g} m, the "
        "space between the walls (grid {}, bound {})",
        body.name, kAxes[axis], bounds.min[axis], bounds.max[axis], low, high, grid.n, grid.bound));
  }
}

// The largest speed that the body can reach: what it has and what falling to the walls adds.
double largest_speed(const BodyParticles& particles, const kernels::GridSettings& grid) {
  const double low = grid.bound * grid.dx(), high = 1 - low;
  double square = 0;
  for (std::size_t p = 0; p < particles.x.size(); ++p) {
    double fall = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double g = grid.gravity[axis];
      const double way = g < 0 ? particles.x[p][axis] - low : high - particles.x[p][axis];
      fall += 2 * std::abs(g) * std::max(way, 0.0);
    }
    square = std::max(square, particles.v[p].squaredNorm() + fall);
  }
  return std::sqrt(square);
}

double stable_step_of(const SceneDescription& scene, const BodyDescription& body,
                      const BodyParticles& particles) {
  try {
    return stable_time_step(estimate_stiffness(body.law), body.density, scene.grid.dx(),
                            largest_speed(particles, scene.grid), scene.safety);
  } catch (const Error& error) {
    throw Error(fmt::format("body \"{}\": {}", body.name, error.what()));
  }
}

template <class T>
std::vector<T> cast(const std::vector<double>& values) {
  return std::vector<T>(values.begin(), values.end());
}

template <class T>
ParticleState widened(const kernels::ParticleState<T>& state) {
  const auto wide = [](const std::vector<T>& values) {
    return std::vector<double>(values.begin(), values.end());
  };
  return {wide(state.x), wide(state.v), wide(state.C), wide(state.F)};
}

template <class T>
ParticleState run(const SceneDescription& scene, const PlacedScene& placed, FrameFields fields,
                  const FrameFunction& on_frame) {
  Scene<T> runnable = build_scene<T>(scene, placed);
  kernels::RunOptions<T> options;
  options.every = scene.frame_stride;
  options.frame_v = fields.v;
  options.frame_C = fields.C;
  options.frame_F = fields.F;
  options.on_frame = [&](std::ptrdiff_t step, const kernels::ParticleState<T>& state) {
    return on_frame(static_cast<double>(step) * placed.grid.dt, step, widened(state));
  };
  runnable.rollout.run(runnable.initial, placed.steps, options);
  return widened(runnable.initial);
}

}  // namespace

PlacedScene place_scene(const SceneDescription& scene) {
  check_settings(scene);
  PlacedScene placed;
  placed.grid = scene.grid;
  if (scene.dt) placed.grid.dt = *scene.dt;
  placed.grid.check();
  placed.first.push_back(0);
  double stable = std::numeric_limits<double>::infinity();
  std::vector<BodyParticles> all;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyDescription& body = scene.bodies[b];
    all.push_back(place_body(body));
    const BodyParticles& particles = all.back();
    check_extent(body, particles, scene.grid);
    stable = std::min(stable, stable_step_of(scene, body, particles));
    for (const Vector3d& x : particles.x) placed.x.insert(placed.x.end(), x.data(), x.data() + 3);
    for (const Vector3d& v : particles.v) placed.v.insert(placed.v.end(), v.data(), v.data() + 3);
    placed.mass.insert(placed.mass.end(), particles.mass.begin(), particles.mass.end());
    placed.volume.insert(placed.volume.end(), particles.volume.begin(), particles.volume.end());
    placed.body.insert(placed.body.end(), particles.x.size(), static_cast<std::int32_t>(b));
    placed.first.push_back(placed.particles());
  }
  check_overlap(scene.bodies, all);
  placed.stable_dt = stable;
  if (!scene.dt) {
    if (!(std::isfinite(stable) && stable > 1e-12)) {
      throw Error(
          fmt::format("scene: dt: auto finds {:.3g} s: expected a law with a finite "
                      "stiffness, or dt as a number",
                      stable));
    }
    placed.grid.dt = round_time_step(stable);
  }
  placed.steps = scene.steps;
  if (scene.duration) {
    const double steps = std::ceil(*scene.duration / placed.grid.dt * (1 - 1e-12));
    if (!(steps >= 0 && steps <= 1e9)) {
      throw Error(fmt::format("scene: duration {} s: expected at most 1e9 steps of {} s",
                              *scene.duration, placed.grid.dt));
    }
    placed.steps = static_cast<std::int64_t>(steps);
  }
  return placed;
}

template <class T>
Scene<T> build_scene(const SceneDescription& scene, const PlacedScene& placed) {
  std::vector<kernels::BodyRange<T>> ranges;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    ranges.push_back(
        {placed.first[b], placed.first[b + 1], kernels::make_law<T>(scene.bodies[b].law)});
  }
  return {kernels::Rollout<T>(placed.grid, std::move(ranges), cast<T>(placed.mass),
                              cast<T>(placed.volume)),
          kernels::ParticleState<T>::undeformed(cast<T>(placed.x), cast<T>(placed.v))};
}
template Scene<float> build_scene<float>(const SceneDescription&, const PlacedScene&);
template Scene<double> build_scene<double>(const SceneDescription&, const PlacedScene&);

ParticleState run_scene(const SceneDescription& scene, const PlacedScene& placed,
                        FrameFields fields, const FrameFunction& on_frame) {
  return scene.single_precision ? run<float>(scene, placed, fields, on_frame)
                                : run<double>(scene, placed, fields, on_frame);
}

Trajectory run_scene(const SceneDescription& scene, FrameFields fields, const std::string& yaml) {
  const PlacedScene placed = place_scene(scene);
  Trajectory trajectory;
  trajectory.body = placed.body;
  trajectory.mass = placed.mass;
  trajectory.volume = placed.volume;
  trajectory.scene = yaml;
  trajectory.particles = placed.particles();
  const auto append = [](const std::vector<double>& from, std::vector<double>* to) {
    to->insert(to->end(), from.begin(), from.end());
  };
  trajectory.last = run_scene(scene, placed, fields,
                              [&](double time, std::int64_t step, const ParticleState& state) {
                                trajectory.time.push_back(time);
                                trajectory.step.push_back(step);
                                append(state.x, &trajectory.x);
                                append(state.v, &trajectory.v);
                                append(state.C, &trajectory.C);
                                append(state.F, &trajectory.F);
                                ++trajectory.frames;
                                return true;
                              });
  return trajectory;
}

}  // namespace uniphy
