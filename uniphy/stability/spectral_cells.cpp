#include "uniphy/stability/spectral_cells.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "models/torchscript.hpp"
#include "ops/base/torch.hpp"
#include "ops/laws/kirchhoff_stress.hpp"
#include "ops/laws/return_mapping.hpp"
#include "ops/learned/learned_law.hpp"
#include "uniphy/stability/gradient_check.hpp"
#include "uniphy/stability/spectral_states.hpp"
#include "uniphy/stability/svd_derivatives.hpp"

namespace uniphy::stability {
namespace {

using kernels::LawId;
using torch::Tensor;

constexpr double kDt = kernels::kFlowStep;  ///< s, of viscoplastic flow
/// The published law of 4 × 128 takes some 20 µs a state, and a check 54 evaluations.
constexpr std::int64_t kPublishedStates = 2000;
/// Rotations are stretched by this for the return mapping of sand: tension, which maps to U Vᵀ.
constexpr double kTension = 1 + 1e-4;

/// Both outputs side by side, [P, 18], the stress in units of its modulus.
Tensor side_by_side(const Tensor& F_proj, const Tensor& tau, double modulus) {
  return torch::cat({F_proj.flatten(1), tau.flatten(1) / modulus}, 1);
}

StateFunction kernel_function(const kernels::LawDescription& law) {
  const ops::Material material = ops::material_of(law);
  const double modulus = law.lambda + 2 * law.mu;
  return [law, material, modulus](const Tensor& F) {
    const Tensor F_proj = ops::return_mapping(law.id, F, material, kDt);
    return side_by_side(F_proj, ops::kirchhoff_stress(law.id, F_proj, {}, material), modulus);
  };
}

StateFunction svd_function(const kernels::LawDescription& law, SvdDerivative derivative) {
  const double modulus = law.lambda + 2 * law.mu;
  return [law, derivative, modulus](const Tensor& F) {
    const PlasticTensors out = plastic_tensors(law, svd_with(derivative, F), F, kDt);
    return side_by_side(out.F_proj, out.tau, modulus);
  };
}

StateFunction learned_function(const kernels::LawDescription& law, double modulus) {
  const auto networks =
      std::make_shared<ops::LearnedNetworks>(ops::to_networks(*law.weights, torch::kFloat64));
  const Tensor z = torch::tensor(law.z, torch::kFloat64);
  return [networks, z, modulus](const Tensor& F) {
    const ops::LawOutput out =
        ops::learned_law(*networks, F, torch::zeros_like(F.detach()), z, kDt);
    return side_by_side(out.F_proj, out.tau, modulus);
  };
}

StateFunction exported_function(const kernels::LawDescription& law, double modulus) {
  const auto script = std::make_shared<models::ScriptLaw>(
      models::ScriptLaw{models::script_law(*law.weights, torch::kFloat64), law.weights->form,
                        law.weights->latent_size, torch::kFloat64});
  const Tensor z = torch::tensor(law.z, torch::kFloat64);
  return [script, z, modulus](const Tensor& F) {
    const Tensor F_proj = script->project(F, z, kDt);
    return side_by_side(F_proj, script->stress(F_proj, torch::zeros_like(F.detach()), z), modulus);
  };
}

bool through_svd(const std::string& method) {
  return method == "raw_svd" || method == "clamped_svd" || method == "nan_to_zero";
}
SvdDerivative derivative_of(const std::string& method) {
  return method == "clamped_svd" ? SvdDerivative::clamped : SvdDerivative::raw;
}

std::vector<double> scaled(std::vector<double> F, double factor) {
  for (double& f : F) f *= factor;
  return F;
}

using States = std::shared_ptr<const StateSet>;

void add_law(Plan& plan, const StabilityOptions& o, const Subjects& all, const States& set,
             const std::string& method, const Subject& subject) {
  PlannedCell cell{set->stressor, method, subject.material, "", {}};
  cell.settings =
      fmt::format("{} {} {} {}", o.seed, o.spectral_states, o.spectral_condition, all.fingerprint);
  const double factor = set->at_tip && subject.material == "sand" ? kOffTheTip : 1;
  cell.measure = [o, set, method, subject, factor](Cell& out) {
    GradientCheck check;
    check.seed = o.seed + 1;
    check.zero_not_finite = method == "nan_to_zero";
    std::vector<double> F = scaled(set->F, factor);
    const kernels::LawDescription& law = subject.law(method);
    if (law.id == LawId::learned) {
      const double modulus = subject.analytic.lambda + 2 * subject.analytic.mu;
      check.reference = learned_function(law, modulus);
      check.function = method == "exported" ? exported_function(law, modulus) : check.reference;
      if (method == "published") F.resize(std::min<std::size_t>(F.size(), 9 * kPublishedStates));
    } else {
      check.reference = kernel_function(law);
      check.function =
          through_svd(method) ? svd_function(law, derivative_of(method)) : check.reference;
    }
    check_gradients(F, check, out);
  };
  plan.push_back(std::move(cell));
}

/// The largest entry of dL/dF through U and V each on its own.
double factor_gradient(const std::vector<double>& F, const std::string& method) {
  const Tensor all = torch::tensor(F, torch::kFloat64).view({-1, 3, 3}).clone().requires_grad_();
  const ops::Svd3 s = through_svd(method) ? svd_with(derivative_of(method), all) : ops::svd3(all);
  const Tensor w = torch::linspace(-1, 1, 9, torch::kFloat64).view({3, 3});
  Tensor g = torch::autograd::grad({(s.U * w).sum() + (s.Vh * w.flip({0})).sum()}, {all})[0];
  if (method == "nan_to_zero") g = torch::nan_to_num(g, 0, 0, 0);
  return g.abs().max().item<double>();
}

void add_rotation(Plan& plan, const StabilityOptions& o, const States& set,
                  const std::string& method, const Subject& sand) {
  PlannedCell cell{set->stressor, method, "U V^T", "", {}};
  cell.settings = fmt::format("{} {}", o.seed, o.spectral_states);
  cell.measure = [o, set, method, law = sand.analytic](Cell& out) {
    GradientCheck check;
    check.seed = o.seed + 2;
    check.zero_not_finite = method == "nan_to_zero";
    check.exact = polar_rotation_gradient;
    if (through_svd(method)) {
      check.function = [derivative = derivative_of(method)](const Tensor& F) {
        const ops::Svd3 s = svd_with(derivative, F);
        return torch::matmul(s.U, s.Vh).flatten(1);
      };
    } else {
      check.function = [law, material = ops::material_of(law)](const Tensor& F) {
        return ops::return_mapping(law.id, F, material, kDt).flatten(1);
      };
    }
    const std::vector<double> F = scaled(set->F, kTension);
    check_gradients(F, check, out);
    out.set("factor_gradient", factor_gradient(F, method));
  };
  plan.push_back(std::move(cell));
}

}  // namespace

Plan spectral_cells(const StabilityOptions& o, const Subjects& subjects) {
  Plan plan;
  for (StateSet& made : spectral_states(o)) {
    const auto set = std::make_shared<const StateSet>(std::move(made));
    for (const Subject& subject : subjects.materials) {
      const LawId id = subject.analytic.id;
      const bool plastic =
          id == LawId::plasticine || id == LawId::sand || id == LawId::non_newtonian;
      for (const char* method : {"analytic", "raw_svd", "clamped_svd", "nan_to_zero"}) {
        if (plastic && o.has_method(method)) add_law(plan, o, subjects, set, method, subject);
      }
      for (const char* method : {"isotropic", "exported"}) {
        if (o.has_method(method)) add_law(plan, o, subjects, set, method, subject);
      }
      if (o.has_method("published") && id == LawId::plasticine)
        add_law(plan, o, subjects, set, "published", subject);
      if (id != LawId::sand || (set->stressor != "rotation" && set->stressor != "near_rotation"))
        continue;
      for (const char* method : {"analytic", "raw_svd", "clamped_svd", "nan_to_zero"}) {
        if (o.has_method(method)) add_rotation(plan, o, set, method, subject);
      }
    }
  }
  return plan;
}

}  // namespace uniphy::stability
