#include "uniphy/stability/time_step_cells.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "uniphy/data/material_ranges.hpp"
#include "uniphy/stability/stability_runs.hpp"
#include "uniphy/stability/stability_scenes.hpp"

namespace uniphy::stability {
namespace {

using kernels::LawDescription;
using kernels::LawId;

constexpr double kFieldStep = 5e-4;  ///< s, of NCLaw's benchmark scenes

/// A material with the upper ends of all its ranges, moduli and viscosities times `factor`; yield
/// stress and friction angle as they are.
LawDescription upper_end(const MaterialRanges& ranges, double stiff, double viscous) {
  MaterialParameters ends{};
  ends.fill(1);
  LawDescription law = material_at(ranges, ends);
  if (law.id == LawId::newtonian) {
    law.mu *= viscous;  // Pa s
  } else {
    law.mu *= stiff;
    law.eta *= viscous;
  }
  law.lambda *= stiff;
  return law;
}

/// The code of a family whose first modulus is the largest; its stress scale times `stiff`.
LawDescription stiffest_code(const Subjects& all, const Subject& subject, double stiff) {
  LawDescription law = subject.isotropic;
  double top = 0;
  for (std::int64_t i = 0; i < all.model.codes(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (all.model.materials[at] != subject.material) continue;
    const double modulus = all.model.parameters[at][1];  // λ, which all five have
    if (modulus <= top) continue;
    top = modulus;
    law.z = all.model.code(i);
  }
  if (!law.z.empty()) law.z[0] += std::log(stiff) / kernels::kStressRate;
  return law;
}

void add_steps(Plan& plan, const StabilityOptions& o, const Subjects& all, const Subject& subject) {
  for (const char* method : {"analytic", "isotropic", "published", "unchecked_step"}) {
    if (!o.has_method(method)) continue;
    SceneDescription scene = cube_on_floor(subject.law(method), o.per_side, o.steps);
    const double stable = place_scene(scene).stable_dt;
    for (const double factor : {0.25, 0.5, 1.0, 2.0, 4.0, 16.0}) {
      scene.dt = factor * stable;
      add_rollout(plan, o, all, factor <= 1 ? "time_step" : "time_step_beyond", method,
                  fmt::format("{} {} x stable", subject.material, factor), scene);
    }
  }
}

/// `auto` by ours, the field's fixed step by the reference.
void add_analytic(Plan& plan, const StabilityOptions& o, const Subjects& all,
                  const std::string& stressor, const std::string& setting,
                  const LawDescription& law) {
  for (const char* method : {"analytic", "unchecked_step"}) {
    if (!o.has_method(method)) continue;
    SceneDescription scene = cube_on_floor(law, o.per_side, o.steps);
    if (std::string(method) == "unchecked_step") scene.dt = kFieldStep;
    add_rollout(plan, o, all, stressor, method, setting, scene);
  }
}

}  // namespace

void add_rollout(Plan& plan, const StabilityOptions& o, const Subjects& all,
                 const std::string& stressor, const std::string& method, const std::string& setting,
                 const SceneDescription& scene) {
  PlannedCell cell{stressor, method, setting, "", {}};
  cell.settings = fmt::format("{} {} {} {} {} {:.17g}", o.seed, o.steps, o.per_side, o.drawn,
                              all.fingerprint, scene.dt.value_or(0));
  const bool unchecked = method == "unchecked_step";
  const double epsilon = method == "mass_epsilon" ? kMassEpsilon : 0;
  cell.measure = [scene, unchecked, epsilon](Cell& out) {
    if (unchecked || epsilon > 0) {
      run_unchecked(scene, epsilon, out);
    } else {
      run_checked(scene, out);
    }
  };
  plan.push_back(std::move(cell));
}

Plan time_step_cells(const StabilityOptions& o, const Subjects& all) {
  Plan plan;
  for (const Subject& subject : all.materials) add_steps(plan, o, all, subject);
  const std::vector<MaterialRanges>& families = default_material_ranges();
  for (std::size_t f = 0; f < families.size(); ++f) {
    const Subject& subject = all.materials[f];
    for (const double stiff : {1.0, 10.0}) {
      const std::string setting = fmt::format("{} upper end x {}", families[f].name(), stiff);
      add_analytic(plan, o, all, "stiffness", setting, upper_end(families[f], stiff, 1));
      if (o.has_method("isotropic")) {
        add_rollout(plan, o, all, "stiffness", "isotropic", setting,
                    cube_on_floor(stiffest_code(all, subject, stiff), o.per_side, o.steps));
      }
    }
  }
  for (const MaterialRanges& ranges : families) {
    if (ranges.id != LawId::newtonian && ranges.id != LawId::non_newtonian) continue;
    for (const double viscous : {1.0, 10.0, 100.0, 1000.0}) {
      add_analytic(plan, o, all, "viscosity",
                   fmt::format("{} upper end x {}", ranges.name(), viscous),
                   upper_end(ranges, 1, viscous));
    }
  }
  return plan;
}

}  // namespace uniphy::stability
