#include "uniphy/stability/precision_cells.hpp"

#include <fmt/format.h>

#include <cmath>

#include "ops/kernels/base/statistics.hpp"
#include "uniphy/stability/stability_runs.hpp"
#include "uniphy/stability/stability_scenes.hpp"

namespace uniphy::stability {
namespace {

constexpr double kSide = 0.5;  ///< m, of cube_on_floor

void measure(SceneDescription scene, Cell& out) {
  ParticleState wide, narrow;
  run_checked(scene, out, &wide);
  out.deciding = "drift";
  if (out.verdict != Verdict::holds) return;
  scene.single_precision = true;
  run_checked(scene, out, &narrow);
  out.deciding = "drift";
  if (out.verdict != Verdict::holds) return;
  const auto count = static_cast<std::ptrdiff_t>(wide.x.size());
  const double square = kernels::squared_distance(wide.x.data(), narrow.x.data(), count);
  const double drift = std::sqrt(3 * square / static_cast<double>(count)) / kSide;
  out.set("drift", drift);
  if (drift <= kDriftTolerance) return;
  out.verdict = Verdict::fails;
  out.failure = {scene.steps, -1,
                 fmt::format("float32 is {:.2g} of the body's side away from float64", drift)};
}

}  // namespace

Plan precision_cells(const StabilityOptions& o, const Subjects& all) {
  Plan plan;
  for (const Subject& subject : all.materials) {
    for (const char* method : {"analytic", "isotropic"}) {
      if (!o.has_method(method)) continue;
      PlannedCell cell{"precision",
                       method,
                       fmt::format("{} {} steps", subject.material, o.drift_steps),
                       fmt::format("{} {}", o.per_side, all.fingerprint),
                       {}};
      const SceneDescription scene = cube_on_floor(subject.law(method), o.per_side, o.drift_steps);
      cell.measure = [scene](Cell& out) { measure(scene, out); };
      plan.push_back(std::move(cell));
    }
  }
  return plan;
}

}  // namespace uniphy::stability
