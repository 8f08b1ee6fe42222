#include "ops/laws/return_mapping.hpp"

#include <cmath>
#include <string>

#include "ops/base/once_differentiable.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::ops {

using kernels::LawId;
using kernels::View;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

/// One number a particle; absent where the tensor is undefined or empty.
template <class T>
View<const T> memory_view(const Tensor& memory) {
  if (!memory.defined() || memory.numel() == 0) return {};
  return {memory.data_ptr<T>(), 1, 1};
}
template <class T>
View<T> mutable_memory_view(const Tensor& memory) {
  if (!memory.defined() || memory.numel() == 0) return {};
  return {memory.data_ptr<T>(), 1, 1};
}

template <class T>
void forward_kernel(int law, const Tensor& F, const Tensor& memory, const Tensor& packed, double dt,
                    const Tensor& F_proj, const Tensor& memory_after) {
  const auto& entry = kernels::law_table<T>().laws[law];
  const auto parameters = law_parameters<T>(packed);
  const View<const T> f = matrix_view<T>(F);
  const View<T> projected = mutable_matrix_view<T>(F_proj);
  const kernels::LawMemory<T> of_law{memory_view<T>(memory), mutable_memory_view<T>(memory_after)};
  for_each_block(F.size(0), [&](std::ptrdiff_t p, std::ptrdiff_t count) {
    entry.project(count, parameters, T(dt), f.from(p), projected.from(p), of_law.from(p));
  });
}

template <class T>
Tensor backward_kernel(int law, const Tensor& F, const Tensor& memory, const Tensor& packed,
                       double dt, const variable_list& grad, const Tensor& grad_F,
                       const Tensor& grad_memory, bool parameters_too) {
  const auto& entry = kernels::law_table<T>().laws[law];
  const auto parameters = law_parameters<T>(packed);
  const View<const T> f = matrix_view<T>(F), g = matrix_view<T>(grad[0]);
  const View<T> gf = mutable_matrix_view<T>(grad_F);
  const kernels::LawMemoryAdjoint<T> of_law{memory_view<T>(memory), memory_view<T>(grad[1]),
                                            mutable_memory_view<T>(grad_memory)};
  return sum_over_blocks<T>(
      F.size(0), packed, parameters_too,
      [&](std::ptrdiff_t p, std::ptrdiff_t count, kernels::LawParameters<T>* share) {
        entry.project_adjoint(count, parameters, T(dt), f.from(p), g.from(p), gf.from(p), share,
                              of_law.from(p));
      });
}

/// memory is empty for a law without, which has one answer.
class ReturnMappingFunction : public torch::autograd::Function<ReturnMappingFunction> {
 public:
  static variable_list forward(AutogradContext* ctx, const Tensor& F, const Tensor& packed,
                               const Tensor& memory, int64_t law, double dt) {
    const Tensor f = F.contiguous(), before = memory.contiguous();
    const Tensor F_proj = torch::empty_like(f), after = torch::empty_like(before);
    for_real_type(f.scalar_type(), [&](auto real) {
      forward_kernel<decltype(real)>(int(law), f, before, packed, dt, F_proj, after);
    });
    ctx->save_for_backward({f, before, packed});
    ctx->saved_data["law"] = law;
    ctx->saved_data["dt"] = dt;
    ctx->set_materialize_grads(false);
    return kernels::law_has_memory(LawId(law)) ? variable_list{F_proj, after}
                                               : variable_list{F_proj};
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    grad.resize(2);
    if (!grad[0].defined() && !grad[1].defined()) return variable_list(5);
    const auto saved = ctx->get_saved_variables();
    const Tensor &F = saved[0], &memory = saved[1];
    const int law = int(ctx->saved_data["law"].toInt());
    const double dt = ctx->saved_data["dt"].toDouble();
    for (Tensor& g : grad)
      if (g.defined()) g = g.contiguous();
    Tensor grad_F, grad_memory;
    if (ctx->needs_input_grad(0)) grad_F = torch::empty_like(F);
    if (ctx->needs_input_grad(2)) grad_memory = torch::empty_like(memory);
    const bool parameters_too = ctx->needs_input_grad(1);
    Tensor grad_packed;
    for_real_type(F.scalar_type(), [&](auto real) {
      grad_packed = backward_kernel<decltype(real)>(law, F, memory, saved[2], dt, grad, grad_F,
                                                    grad_memory, parameters_too);
    });
    return once_differentiable("return_mapping",
                               {grad_F, grad_packed, grad_memory, Tensor(), Tensor()});
  }
};

variable_list apply(const char* op, LawId law, const Tensor& F, const Tensor& memory,
                    const Material& material, double dt) {
  if (!(std::isfinite(dt) && dt >= 0))
    throw Error(std::string(op) + ": dt: expected a finite number >= 0, found " +
                std::to_string(dt));
  const Tensor packed = pack_material(op, law, material);
  return ReturnMappingFunction::apply(F, packed, memory, int64_t(law), dt);
}

void check_memory_of(const char* op, LawId law, bool expected) {
  if (kernels::law_has_memory(law) == expected) return;
  throw Error(std::string(op) + ": law: expected one " + (expected ? "with" : "without") +
              " memory, found " + kernels::law_name(law) +
              (expected ? "" : " (return_mapping_with_memory takes it)"));
}

}  // namespace

Tensor return_mapping(LawId law, const Tensor& F, const Material& material, double dt) {
  check_matrices("return_mapping", "F", F);
  check_memory_of("return_mapping", law, false);
  const Tensor none = torch::empty({0}, F.options().requires_grad(false));
  return apply("return_mapping", law, F, none, material, dt)[0];
}

MemoryMapping return_mapping_with_memory(LawId law, const Tensor& F, const Tensor& memory,
                                         const Material& material, double dt) {
  const char* op = "return_mapping_with_memory";
  check_matrices(op, "F", F);
  check_memory_of(op, law, true);
  const Tensor before = checked(op, "memory", memory, F.scalar_type(), {F.size(0)});
  const variable_list out = apply(op, law, F, before, material, dt);
  return {out[0], out[1]};
}

}  // namespace uniphy::ops
