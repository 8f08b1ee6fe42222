#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "ops/kernels/rollout/rollout.hpp"
#include "uniphy/io/trajectory.hpp"
#include "uniphy/scene/body.hpp"
#include "uniphy/scene/time_step.hpp"

namespace uniphy {

/// A scene in the unit cube: everything that a simulation needs, with no file behind it.
///
///   SceneDescription scene;
///   BodyDescription cube;
///   cube.solid = make_shape("box");
///   cube.placement.size = 0.5;
///   cube.law.id = kernels::LawId::elastic;  cube.law.mu = 1e5;  cube.law.lambda = 2e5;
///   scene.bodies.push_back(cube);
///   Trajectory trajectory = run_scene(scene);
struct SceneDescription {
  /// n, gravity (m/s²), walls, thickness of the walls (nodes); grid.dt is replaced by `dt`.
  kernels::GridSettings grid;
  std::optional<double> dt;         ///< s; absent: from stable_time_step, rounded down
  double safety = kTimeStepSafety;  ///< share of the stable step that an automatic dt takes
  std::int64_t steps = 1000;
  std::optional<double> duration;   ///< s; where given it sets steps = ceil(duration/dt)
  std::int64_t frame_stride = 5;    ///< steps from frame to frame
  bool single_precision = false;    ///< float32 instead of float64
  std::filesystem::path continued;  ///< trajectory.h5 whose run goes on; empty: from the start
  std::vector<BodyDescription> bodies;
};

/// All particles of a scene before the first step, in double precision, bodies one after another.
struct PlacedScene {
  kernels::GridSettings grid;  ///< with the resolved dt
  std::int64_t steps = 0;
  double stable_dt = 0;               ///< s, what stable_time_step allows
  std::vector<double> x, v;           ///< [P, 3] m, m/s
  std::vector<double> mass, volume;   ///< [P] kg, m³
  std::vector<std::int32_t> body;     ///< [P]
  std::vector<std::ptrdiff_t> first;  ///< [bodies + 1]: body b is first[b] … first[b + 1] − 1
  std::optional<RunState> start;      ///< where an earlier run ended, in place of x and v

  std::ptrdiff_t particles() const { return static_cast<std::ptrdiff_t>(mass.size()); }
};

/// Fills and places all bodies and fixes dt and the number of steps. Throws Error naming the body
/// and its extent where it does not stand between the walls, whose planes are the innermost nodes
/// that they stop: (bound − 1) Δx and 1 − (bound − 1) Δx, naming two bodies that overlap
/// (overlap.hpp), and naming the body and the parameter where a law is not complete.
PlacedScene place_scene(const SceneDescription& scene);

/// A scene that can run: the engine and the state before the first step (F = I, C = 0, unless the
/// scene goes on from an earlier run).
template <class T>
struct Scene {
  kernels::Rollout<T> rollout;
  kernels::ParticleState<T> initial;
};
template <class T>
Scene<T> build_scene(const SceneDescription& scene, const PlacedScene& placed);

/// Frame `step` at `time` (s); x is always there, v, C and F as `fields` ask. Returning false ends
/// the run.
using FrameFunction =
    std::function<bool(double time, std::int64_t step, const ParticleState& state)>;

/// Runs in the scene's precision, hands over the states 0, stride, 2 stride, … (of a run that goes
/// on: its first one and those multiples) and returns the last state with all fields, and in *end,
/// unless null, where it stands.
ParticleState run_scene(const SceneDescription& scene, const PlacedScene& placed,
                        FrameFields fields, const FrameFunction& on_frame, RunPoint* end = nullptr);

/// The whole trajectory in memory. `yaml` is stored as its scene.
Trajectory run_scene(const SceneDescription& scene, FrameFields fields = {},
                     const std::string& yaml = "");

}  // namespace uniphy
