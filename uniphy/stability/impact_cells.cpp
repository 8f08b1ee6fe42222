#include "uniphy/stability/impact_cells.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "uniphy/data/material_ranges.hpp"
#include "uniphy/stability/stability_runs.hpp"
#include "uniphy/stability/stability_scenes.hpp"
#include "uniphy/stability/time_step_cells.hpp"

namespace uniphy::stability {
namespace {

/// ‖Σ m v − before‖ over ½ Σ m |v| before: the momentum of one of two bodies that meet, half that
/// of one that flies alone.
double momentum_drift(const PlacedScene& placed, const ParticleState& last) {
  double drift[3] = {0, 0, 0}, size = 0;
  for (std::ptrdiff_t p = 0; p < placed.particles(); ++p) {
    double square = 0;
    for (int a = 0; a < 3; ++a) {
      const double before = placed.v[3 * p + a];
      drift[a] += placed.mass[p] * (last.v[3 * p + a] - before);
      square += before * before;
    }
    size += 0.5 * placed.mass[p] * std::sqrt(square);
  }
  return std::sqrt(drift[0] * drift[0] + drift[1] * drift[1] + drift[2] * drift[2]) / size;
}

/// The roll-outs of add_rollout, judged by the momentum as well.
void add_momentum(Plan& plan, const StabilityOptions& o, const Subjects& all,
                  const std::string& stressor, const std::string& method,
                  const std::string& setting, const SceneDescription& scene) {
  add_rollout(plan, o, all, stressor, method, setting, scene);
  const bool unchecked = method == "unchecked_step" || method == "mass_epsilon";
  const double epsilon = method == "mass_epsilon" ? kMassEpsilon : 0;
  plan.back().measure = [scene, unchecked, epsilon](Cell& out) {
    ParticleState last;
    if (unchecked) {
      run_unchecked(scene, epsilon, out, &last);
    } else {
      run_checked(scene, out, &last);
    }
    out.deciding = "momentum_drift";
    if (last.x.empty()) return;
    const double drift = momentum_drift(place_scene(scene), last);
    out.set("momentum_drift", drift);
    if (out.verdict != Verdict::holds || drift <= kMomentumTolerance) return;
    out.verdict = Verdict::fails;
    out.failure = {static_cast<std::int64_t>(out.find("steps").value_or(0)), -1,
                   fmt::format("{:.3g} of the momentum is gone, in silence", drift)};
  };
}

}  // namespace

Plan impact_cells(const StabilityOptions& o, const Subjects& all) {
  Plan plan;
  const std::vector<double> speeds{1, 5, 20, 50};
  for (const Subject& subject : all.materials) {
    for (const char* method : {"analytic", "isotropic", "published"}) {
      if (!o.has_method(method)) continue;
      const kernels::LawDescription& law = subject.law(method);
      for (const double speed : speeds) {
        const std::string setting = fmt::format("{} {} m/s", subject.material, speed);
        add_rollout(plan, o, all, "impact_wall", method, setting,
                    thrown_at_wall(law, speed, o.per_side, o.steps));
        add_rollout(plan, o, all, "impact_corner", method, setting,
                    thrown_into_corner(law, speed, o.per_side, o.steps));
        // Long enough a flight at `auto` that the bodies meet and part.
        add_momentum(plan, o, all, "collision", method, setting,
                     two_cubes(law, speed, o.per_side, o.steps));
      }
      for (const double pull : {10.0, 100.0, 1000.0}) {
        add_rollout(plan, o, all, "pushed", method,
                    fmt::format("{} {} m/s^2", subject.material, pull),
                    pushed_at_wall(law, pull, o.per_side, o.steps));
      }
    }
  }
  if (o.has_method("analytic")) {
    kernels::LawDescription soft =
        material_at(default_material_ranges().front(), MaterialParameters{});
    for (const double speed : speeds) {
      add_rollout(plan, o, all, "soft_impact", "analytic", fmt::format("{} m/s", speed),
                  thrown_at_wall(soft, speed, o.per_side, o.steps));
    }
  }
  for (const double density : {1000.0, 10.0, 1.0, 0.1}) {
    for (const char* method : {"analytic", "isotropic", "mass_epsilon"}) {
      if (!o.has_method(method)) continue;
      SceneDescription scene =
          free_flight(all.materials.front().law(method), density, o.per_side, o.steps);
      // The law of this row is at rest; the time in which the body stays clear of the walls.
      scene.dt = std::min(0.2 / static_cast<double>(o.steps), place_scene(scene).stable_dt);
      add_momentum(plan, o, all, "light_body", method, fmt::format("{} kg/m^3", density), scene);
    }
  }
  return plan;
}

}  // namespace uniphy::stability
