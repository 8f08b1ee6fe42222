#include "uniphy/stability/latent_cells.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "uniphy/geometry/random.hpp"
#include "uniphy/stability/dissipation.hpp"
#include "uniphy/stability/stability_scenes.hpp"
#include "uniphy/stability/time_step_cells.hpp"

namespace uniphy::stability {
namespace {

using kernels::LawDescription;

/// By Box and Muller; the distributions of <random> differ between standard libraries.
double normal(UniformRandom& random) {
  const double radius = std::sqrt(-2 * std::log(1 - random.unit()));
  return radius * std::cos(2 * 3.14159265358979323846 * random.unit());
}

std::shared_ptr<const kernels::LearnedLawWeights> perturbed(const kernels::LearnedLawWeights& from,
                                                            double share, UniformRandom& random) {
  auto weights = std::make_shared<kernels::LearnedLawWeights>(from);
  for (auto* network : {&weights->projection, &weights->stress}) {
    for (auto& layer : network->layers) {
      for (auto* numbers : {&layer.weight, &layer.bias}) {
        for (double& w : *numbers) w *= 1 + share * normal(random);
      }
    }
  }
  return weights;
}

struct Drawn {
  std::string stressor, setting;
  LawDescription law;
};

/// Codes of the isotropic law that no training saw.
std::vector<Drawn> drawn_codes(const StabilityOptions& o, const Subjects& all) {
  std::vector<Drawn> drawn;
  UniformRandom random(o.seed + 3);
  const LawDescription base = all.materials.front().isotropic;
  const auto some_code = [&] {
    return all.model.code(
        static_cast<std::int64_t>(random.below(static_cast<std::size_t>(all.model.codes()))));
  };
  const auto add = [&](const char* stressor, const std::string& setting, std::vector<double> z) {
    Drawn one{stressor, setting, base};
    one.law.z = std::move(z);
    drawn.push_back(std::move(one));
  };
  for (std::int64_t i = 0; i < 5 * o.drawn; ++i) {
    std::vector<double> a = some_code();
    const std::vector<double> b = some_code(), c = some_code();
    for (std::size_t k = 0; k < a.size(); ++k) a[k] = 0.5 * (a[k] + b[k]);
    add("codes_interpolated", fmt::format("pair {}", i), a);
    for (const double factor : {1.5, 2.0}) {
      std::vector<double> far = c;
      for (double& z : far) z *= factor;
      add("codes_extrapolated", fmt::format("code {} x {}", i, factor), far);
    }
    std::vector<double> any(a.size());
    for (double& z : any) z = normal(random);
    add("codes_random", fmt::format("code {}", i), any);
  }
  return drawn;
}

void add_dissipation(Plan& plan, const StabilityOptions& o, const Subjects& all,
                     const std::string& method, const std::string& setting,
                     const LawDescription& law) {
  PlannedCell cell{"dissipation", method, setting, "", {}};
  cell.settings = fmt::format("{} {} {}", o.seed, o.drawn, all.fingerprint);
  cell.measure = [law, seed = o.seed + 5](Cell& out) {
    // 500 states a law: where a law creates energy at all it does for a sizeable share of them.
    const Dissipation least = least_dissipation(law, 500, seed);
    out.deciding = "least_dissipation";
    out.set("least_dissipation", std::min(least.plastic, least.viscous));
    out.set("plastic", least.plastic);
    out.set("viscous", least.viscous);
    const bool plastic = !(least.plastic >= -kDissipationTolerance),
               viscous = !(least.viscous >= -kDissipationTolerance);
    out.verdict = plastic || viscous ? Verdict::fails : Verdict::holds;
    if (!plastic && !viscous) return;
    out.failure = {-1, plastic ? least.plastic_state : least.viscous_state,
                   plastic ? "its plastic flow creates energy, in silence"
                           : "its viscosity creates energy, in silence"};
  };
  plan.push_back(std::move(cell));
}

}  // namespace

Plan latent_cells(const StabilityOptions& o, const Subjects& all) {
  Plan plan;
  const auto cube = [&](const LawDescription& law) {
    return cube_on_floor(law, o.per_side, o.steps);
  };
  const std::vector<Drawn> drawn = drawn_codes(o, all);
  if (o.has_method("isotropic")) {
    for (const Drawn& d : drawn)
      add_rollout(plan, o, all, d.stressor, "isotropic", d.setting, cube(d.law));
    UniformRandom random(o.seed + 4);
    for (const Subject& subject : all.materials) {
      for (const double share : {0.01, 0.1, 0.3, 1.0}) {
        for (std::int64_t i = 0; i < o.drawn; ++i) {
          LawDescription law = subject.isotropic;
          law.weights = perturbed(*law.weights, share, random);
          add_rollout(plan, o, all, "weights_perturbed", "isotropic",
                      fmt::format("{} {} % #{}", subject.material, 100 * share, i), cube(law));
        }
      }
    }
  }
  for (const Subject& subject : all.materials) {
    for (const char* method : {"published", "unchecked_step"}) {
      if (!o.has_method(method)) continue;
      SceneDescription scene = cube(subject.published);
      if (std::string(method) == "unchecked_step") scene.dt = 5e-4;
      add_rollout(plan, o, all, "weak_network", method, subject.material, scene);
    }
    for (const char* method : {"analytic", "isotropic", "published"}) {
      if (o.has_method(method))
        add_dissipation(plan, o, all, method, subject.material, subject.law(method));
    }
  }
  if (o.has_method("isotropic")) {
    for (const Drawn& d : drawn)
      add_dissipation(plan, o, all, "isotropic", d.stressor + " " + d.setting, d.law);
  }
  return plan;
}

}  // namespace uniphy::stability
