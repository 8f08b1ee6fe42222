#include "uniphy/stability/stability_runs.hpp"

#include <string>
#include <utility>
#include <vector>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/rollout/lost_particle.hpp"
#include "uniphy/scene/scene_warnings.hpp"
#include "uniphy/stability/run_watch.hpp"
#include "uniphy/stability/unchecked_step.hpp"

namespace uniphy::stability {
namespace {

void stop(Cell& cell, const Failure& failure) {
  cell.verdict = Verdict::stops;
  cell.failure = failure;
}

/// What the user was told before the run, for a failure that came without an error.
void add_warnings(const SceneDescription& scene, const PlacedScene& placed, Cell& cell) {
  const std::vector<std::string> warnings = scene_warnings(scene, placed);
  cell.set("warnings", static_cast<double>(warnings.size()));
  if (cell.verdict != Verdict::fails) return;
  for (const std::string& warning : warnings)
    cell.failure.cause += "; warned of before the run: " + warning;
}

/// What the watch saw wins over the error that ended the run later.
void stop_unless_violated(const RunWatch& watch, Cell& cell, const Failure& failure) {
  watch.report(cell);
  if (!watch.violated()) stop(cell, failure);
}

}  // namespace

void run_checked(SceneDescription scene, Cell& cell, ParticleState* last) {
  scene.frame_stride = kLookEvery;
  cell.deciding = "energy_growth";
  if (last != nullptr) *last = {};
  PlacedScene placed;
  try {
    placed = place_scene(scene);
  } catch (const Error& error) {
    stop(cell, {0, -1, error.what()});
    return;
  }
  cell.set("dt", placed.grid.dt);
  RunWatch watch(placed);
  std::int64_t reached = 0;
  try {
    ParticleState end = run_scene(scene, placed, {true, true, true},
                                  [&](double, std::int64_t step, const ParticleState& state) {
                                    reached = step;
                                    return watch.look(step, state);
                                  });
    if (!watch.violated()) {
      reached = placed.steps;
      watch.look(reached, end);
    }
    watch.report(cell);
    if (last != nullptr && !watch.violated()) *last = std::move(end);
  } catch (const kernels::LostParticle& lost) {
    reached = lost.step();
    stop_unless_violated(watch, cell, {lost.step(), lost.particle(), lost.what()});
  } catch (const Error& error) {
    stop_unless_violated(watch, cell, {reached, -1, error.what()});
  }
  cell.set("steps", static_cast<double>(reached));
  add_warnings(scene, placed, cell);
}

void run_unchecked(const SceneDescription& scene, double mass_epsilon, Cell& cell,
                   ParticleState* last) {
  cell.deciding = "energy_growth";
  if (last != nullptr) *last = {};
  const PlacedScene placed = place_scene(scene);
  cell.set("dt", placed.grid.dt);
  UncheckedRollout rollout(scene, placed, mass_epsilon);
  RunWatch watch(placed);
  std::int64_t step = 0;
  while (watch.look(step, rollout.state()) && step < placed.steps) {
    for (std::int64_t k = 0; k < kLookEvery && step < placed.steps; ++k, ++step) rollout.step();
  }
  watch.report(cell);
  cell.set("steps", static_cast<double>(step));
  if (last != nullptr && !watch.violated()) *last = rollout.state();
}

}  // namespace uniphy::stability
