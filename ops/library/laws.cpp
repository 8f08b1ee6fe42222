#include <torch/library.h>

#include <string>
#include <tuple>

#include "ops/base/torch.hpp"
#include "ops/laws/kirchhoff_stress.hpp"
#include "ops/laws/return_mapping.hpp"
#include "ops/library/arguments.hpp"
#include "ops/library/library.hpp"
#include "ops/spectral/svd3.hpp"

// The signed SVD and the analytic laws; F, C [P, 3, 3].

namespace uniphy::ops {

using torch::Tensor;

namespace {

std::tuple<Tensor, Tensor, Tensor> svd3_op(const Tensor& F) {
  const Svd3 r = svd3(F);
  return {r.U, r.sigma, r.Vh};
}

Tensor return_mapping_op(const std::string& law, const Tensor& F, const Tensor& parameters,
                         double dt) {
  const kernels::LawId id = analytic_law("return_mapping", law);
  return return_mapping(id, F, material_of("return_mapping", id, parameters), dt);
}

std::tuple<Tensor, Tensor> return_mapping_with_memory_op(const std::string& law, const Tensor& F,
                                                         const Tensor& memory,
                                                         const Tensor& parameters, double dt) {
  const char* op = "return_mapping_with_memory";
  const kernels::LawId id = analytic_law(op, law);
  const MemoryMapping r =
      return_mapping_with_memory(id, F, memory, material_of(op, id, parameters), dt);
  return {r.F_proj, r.memory};
}

Tensor kirchhoff_stress_op(const std::string& law, const Tensor& F, const c10::optional<Tensor>& C,
                           const Tensor& parameters) {
  const kernels::LawId id = analytic_law("kirchhoff_stress", law);
  return kirchhoff_stress(id, F, C.value_or(Tensor()),
                          material_of("kirchhoff_stress", id, parameters));
}

}  // namespace

void define_laws(torch::Library& library) {
  // F = U diag(sigma) Vh, U and Vh rotations, [P, 3, 3] and sigma [P, 3]: ops/spectral/svd3.hpp.
  library.def("svd3(Tensor F) -> (Tensor U, Tensor sigma, Tensor Vh)", &svd3_op);
  // F_proj = G(F); dt (s) is used by non_newtonian: ops/laws/return_mapping.hpp.
  library.def("return_mapping(str law, Tensor F, Tensor parameters, float dt) -> Tensor",
              &return_mapping_op);
  // The same for a law with one number of memory [P] a particle, 0 at the start.
  library.def(
      "return_mapping_with_memory(str law, Tensor F, Tensor memory, Tensor parameters, float dt) "
      "-> (Tensor F_proj, Tensor memory)",
      &return_mapping_with_memory_op);
  // τ(F, C) in Pa of the projected F; C (1/s) is used by newtonian, None is zero:
  // ops/laws/kirchhoff_stress.hpp.
  library.def("kirchhoff_stress(str law, Tensor F, Tensor? C, Tensor parameters) -> Tensor",
              &kirchhoff_stress_op);
}

}  // namespace uniphy::ops
