#include "ops/learned/learned_law.hpp"

#include <torch/library.h>

#include <string>
#include <tuple>

#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/library/arguments.hpp"
#include "ops/library/library.hpp"

// The learned law: F, C [P, 3, 3], z [Z], numbers of the networks.

namespace uniphy::ops {

using torch::Tensor;

namespace {

/// Z of a code z [Z].
std::int64_t code_size(const char* op, const Tensor& z) {
  check_tensor(op, "z", z, real_type(op, "z", z), {kAnySize});
  return z.size(0);
}

std::tuple<Tensor, Tensor> learned_law_op(const Tensor& F_trial, const Tensor& C, const Tensor& z,
                                          const std::string& form, const std::string& activation,
                                          at::IntArrayRef projection_widths,
                                          const Tensor& projection, at::IntArrayRef stress_widths,
                                          const Tensor& stress, double dt) {
  const LawOutput r =
      learned_law(learned_networks("learned_law", form, activation, projection_widths, projection,
                                   stress_widths, stress, code_size("learned_law", z)),
                  F_trial, C, z, dt);
  return {r.F_proj, r.tau};
}

Tensor learned_project_op(const Tensor& F, const Tensor& z, const std::string& form,
                          const std::string& activation, at::IntArrayRef projection_widths,
                          const Tensor& projection, at::IntArrayRef stress_widths,
                          const Tensor& stress, double dt) {
  return learned_project(
      learned_networks("learned_project", form, activation, projection_widths, projection,
                       stress_widths, stress, code_size("learned_project", z)),
      F, z, dt);
}

Tensor learned_stress_op(const Tensor& F_proj, const Tensor& C, const Tensor& z,
                         const std::string& form, const std::string& activation,
                         at::IntArrayRef projection_widths, const Tensor& projection,
                         at::IntArrayRef stress_widths, const Tensor& stress) {
  return learned_stress(
      learned_networks("learned_stress", form, activation, projection_widths, projection,
                       stress_widths, stress, code_size("learned_stress", z)),
      F_proj, C, z);
}

}  // namespace

void define_learned_law(torch::Library& library) {
  const std::string networks = kNetworkArguments;
  // s, which a viscoplastic projection depends on.
  const std::string step = ", float dt=" + std::to_string(kernels::kFlowStep);
  // F_proj = G(F_trial) and tau = τ(F_proj, C) in Pa, in one pass: ops/learned/learned_law.hpp.
  library.def(("learned_law(Tensor F_trial, Tensor C, Tensor z, *, " + networks + step +
               ") -> (Tensor F_proj, Tensor tau)")
                  .c_str(),
              &learned_law_op);
  library.def(("learned_project(Tensor F, Tensor z, *, " + networks + step + ") -> Tensor").c_str(),
              &learned_project_op);
  library.def(
      ("learned_stress(Tensor F_proj, Tensor C, Tensor z, *, " + networks + ") -> Tensor").c_str(),
      &learned_stress_op);
}

}  // namespace uniphy::ops
