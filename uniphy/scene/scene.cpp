#include "uniphy/scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "ops/kernels/base/error.hpp"
#include "uniphy/scene/continued_run.hpp"
#include "uniphy/scene/memory_check.hpp"
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

// The planes of the walls that act: the innermost nodes whose velocity is clamped, as far as a
// particle there has its whole stencil on the grid. [low, high] m, the same on every axis.
std::array<double, 2> wall_planes(const kernels::GridSettings& grid) {
  const double dx = grid.dx();
  return {std::max(static_cast<double>(grid.bound - 1), 0.5) * dx,
          1 - std::max(static_cast<double>(grid.bound - 1), 1.5) * dx};
}

void check_extent(const BodyDescription& body, const BodyParticles& particles,
                  const kernels::GridSettings& grid) {
  const Bounds bounds = bounds_of(particles.x);
  // Particles given in place (a state of an earlier run, say) may lean into the walls and only have
  // to stay on the grid.
  const double dx = grid.dx();
  const auto [low, high] =
      body.in_place ? std::array<double, 2>{0.5 * dx, 1 - 1.5 * dx} : wall_planes(grid);
  for (int axis = 0; axis < 3; ++axis) {
    if (bounds.min[axis] >= low - 1e-12 && bounds.max[axis] <= high + 1e-12) continue;
    throw Error(fmt::format(
        "body \"{}\": spans {} from {:.6g} to {:.6g} m, expected within {:.6g} to {:.6g} m, the "
        "space between the walls (grid {}, bound {})",
        body.name, kAxes[axis], bounds.min[axis], bounds.max[axis], low, high, grid.n, grid.bound));
  }
}

// Moves the body along the axis of gravity until its surface, half a particle spacing beyond its
// outermost particle, stands on the wall that it would fall to.
void put_on_floor(const kernels::GridSettings& grid, BodyDescription& body,
                  BodyParticles& particles) {
  int axis = 0;
  for (int k = 1; k < 3; ++k) {
    if (std::abs(grid.gravity[k]) > std::abs(grid.gravity[axis])) axis = k;
  }
  if (grid.gravity[axis] == 0) {
    throw Error(fmt::format(
        "body \"{}\": on_floor: expected gravity, which says where the floor is, found none",
        body.name));
  }
  if (body.in_place) {
    throw Error(fmt::format(
        "body \"{}\": on_floor: expected a body that is placed, found particles in place",
        body.name));
  }
  const Bounds bounds = bounds_of(particles.x);
  const double volume = std::accumulate(particles.volume.begin(), particles.volume.end(), 0.0);
  const double half = 0.5 * std::cbrt(volume / static_cast<double>(particles.x.size()));
  const auto [low, high] = wall_planes(grid);
  const double shift =
      grid.gravity[axis] < 0 ? low - (bounds.min[axis] - half) : high - (bounds.max[axis] + half);
  for (Vector3d& x : particles.x) x[axis] += shift;
  body.placement.centre[axis] += shift;
}

// The largest speed that the body can reach: what it has and what falling to the walls adds.
double largest_speed(const BodyParticles& particles, const kernels::GridSettings& grid) {
  const auto [low, high] = wall_planes(grid);
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
  return {wide(state.x), wide(state.v), wide(state.C), wide(state.F), wide(state.memory)};
}

template <class T>
kernels::ParticleState<T> narrowed(const ParticleState& state) {
  return {cast<T>(state.x), cast<T>(state.v), cast<T>(state.C), cast<T>(state.F),
          cast<T>(state.memory)};
}

template <class T>
ParticleState run(const SceneDescription& scene, const PlacedScene& placed, FrameFields fields,
                  const FrameFunction& on_frame, RunPoint* end) {
  Scene<T> runnable = build_scene<T>(scene, placed);
  kernels::SortState<T> sort;
  std::int64_t step = 0;
  if (placed.start) {
    const RunPoint& point = placed.start->point;
    step = point.step;
    sort = {point.steps_sorted, cast<T>(point.sorted_x)};
  }
  kernels::RunOptions<T> options;
  options.every = scene.frame_stride;
  options.frame_v = fields.v;
  options.frame_C = fields.C;
  options.frame_F = fields.F;
  options.sort = &sort;
  options.on_frame = [&](std::ptrdiff_t at, const kernels::ParticleState<T>& state) {
    return on_frame(static_cast<double>(at) * placed.grid.dt, at, widened(state));
  };
  const auto advance = [&](std::int64_t steps) {
    options.first_step = step;
    const std::int64_t done = runnable.rollout.run(runnable.initial, steps, options);
    step += done;
    return done == steps;
  };
  // The roll-out counts frames from its first step; here they stay at multiples of the stride.
  const std::int64_t to_frame =
      (scene.frame_stride - step % scene.frame_stride) % scene.frame_stride;
  if (to_frame == 0) {
    advance(placed.steps);
  } else if (advance(std::min(to_frame, placed.steps)) && to_frame <= placed.steps) {
    advance(placed.steps - to_frame);
  }
  if (end != nullptr) {
    end->step = step;
    end->steps_sorted = sort.steps;
    end->sorted_x.assign(sort.x.begin(), sort.x.end());
    end->scene_hash = scene_hash(scene, placed);
  }
  return widened(runnable.initial);
}

}  // namespace

PlacedScene place_scene(const SceneDescription& scene) {
  check_settings(scene);
  PlacedScene placed;
  placed.grid = scene.grid;
  if (scene.dt) placed.grid.dt = *scene.dt;
  placed.grid.check();
  check_grid_memory("scene.grid", scene.grid.n,
                    scene.single_precision ? sizeof(float) : sizeof(double));
  placed.first.push_back(0);
  double stable = std::numeric_limits<double>::infinity();
  std::vector<BodyDescription> bodies = scene.bodies;
  std::vector<BodyParticles> all;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    BodyDescription& body = bodies[b];
    all.push_back(place_body(body));
    if (body.on_floor) put_on_floor(scene.grid, body, all.back());
    const BodyParticles& particles = all.back();
    check_particle_memory(fmt::format("bodies.{}.filling", b),
                          placed.particles() + static_cast<std::ptrdiff_t>(particles.x.size()));
    check_extent(body, particles, scene.grid);
    stable = std::min(stable, stable_step_of(scene, body, particles));
    for (const Vector3d& x : particles.x) placed.x.insert(placed.x.end(), x.data(), x.data() + 3);
    for (const Vector3d& v : particles.v) placed.v.insert(placed.v.end(), v.data(), v.data() + 3);
    placed.mass.insert(placed.mass.end(), particles.mass.begin(), particles.mass.end());
    placed.volume.insert(placed.volume.end(), particles.volume.begin(), particles.volume.end());
    placed.body.insert(placed.body.end(), particles.x.size(), static_cast<std::int32_t>(b));
    placed.first.push_back(placed.particles());
  }
  check_overlap(bodies, all);
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
          placed.start
              ? narrowed<T>(placed.start->particles)
              : kernels::ParticleState<T>::undeformed(cast<T>(placed.x), cast<T>(placed.v))};
}
template Scene<float> build_scene<float>(const SceneDescription&, const PlacedScene&);
template Scene<double> build_scene<double>(const SceneDescription&, const PlacedScene&);

ParticleState run_scene(const SceneDescription& scene, const PlacedScene& placed,
                        FrameFields fields, const FrameFunction& on_frame, RunPoint* end) {
  return scene.single_precision ? run<float>(scene, placed, fields, on_frame, end)
                                : run<double>(scene, placed, fields, on_frame, end);
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
  trajectory.end.emplace();
  trajectory.last = run_scene(
      scene, placed, fields,
      [&](double time, std::int64_t step, const ParticleState& state) {
        trajectory.time.push_back(time);
        trajectory.step.push_back(step);
        append(state.x, &trajectory.x);
        append(state.v, &trajectory.v);
        append(state.C, &trajectory.C);
        append(state.F, &trajectory.F);
        ++trajectory.frames;
        return true;
      },
      &*trajectory.end);
  return trajectory;
}

}  // namespace uniphy
