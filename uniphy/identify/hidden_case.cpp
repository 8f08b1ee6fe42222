#include "uniphy/identify/hidden_case.hpp"

#include <fmt/format.h>

#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/observed_motion.hpp"
#include "uniphy/scene/scene.hpp"

namespace uniphy {
namespace {

/// The setup of one attempt; its law is that of `law` unless null.
TrajectorySetup draw(const HiddenCaseOptions& options, std::int64_t trajectory,
                     std::int64_t attempt, const kernels::LawDescription* law) {
  TrajectorySetup setup = draw_setup(options.draw, trajectory, attempt);
  setup.scene.frame_stride = options.frame_stride;
  if (law != nullptr) {
    setup.scene.bodies.front().law = *law;
    setup.scene.dt = *options.draw.dt;
  }
  return setup;
}

bool meets_wall_early(const Observation& observation) {
  const ObservedSteps steps = observed_steps(observation, "observation");
  const kernels::GridSettings grid = observed_grid(observation, "observation");
  const RigidMotion motion = observed_motion(observation, steps, grid, 1);
  return 2 * first_contact(observation, steps, grid, motion) < observation.frames;
}

Observation observation_from(const TrajectorySetup& setup, const Trajectory& truth) {
  kernels::GridSettings grid = setup.scene.grid;
  grid.dt = *setup.scene.dt;
  Observation o = begin_observation(grid, setup.scene.bodies.front().density, truth.volume);
  o.frames = truth.frames;
  o.x = truth.x;
  o.time = truth.time;
  return o;
}

}  // namespace

HiddenCase draw_hidden_case(const HiddenCaseOptions& options, std::int64_t material,
                            FrameFields fields) {
  HiddenCase hidden;
  const std::int64_t first = material * options.draw.trajectories;
  std::string reason = "no draw was stable at the time step";
  bool found = false;
  for (std::int64_t a = 0; a < options.draw.attempts && !found; ++a) {
    hidden.observed = draw(options, first, a, nullptr);
    if (hidden.observed.scene.dt != options.draw.dt) continue;
    try {
      hidden.observed_truth = run_scene(hidden.observed.scene);
      found = meets_wall_early(observation_from(hidden.observed, hidden.observed_truth));
      if (!found) reason = "no wall is met in the first half of the observation";
    } catch (const Error& error) {
      reason = error.what();
    }
  }
  if (found) {
    found = false;
    reason = "every draw has the shape of the observed body";
    for (std::int64_t a = 0; a < options.draw.attempts && !found; ++a) {
      hidden.other = draw(options, first + 1, a, &hidden.observed.law());
      if (hidden.other.record.shape == hidden.observed.record.shape) continue;
      try {
        hidden.other_truth = run_scene(hidden.other.scene, fields);
        found = true;
      } catch (const Error& error) {
        reason = error.what();
      }
    }
  }
  if (!found) {
    throw Error(fmt::format("seed {}: no {} scene in {} attempts: {}", options.draw.seed,
                            options.draw.materials[material].name(), options.draw.attempts,
                            reason));
  }
  return hidden;
}

Observation observation_of(const HiddenCase& hidden) {
  return observation_from(hidden.observed, hidden.observed_truth);
}

}  // namespace uniphy
