#include "ops/laws/return_mapping.hpp"

#include <torch/torch.h>

#include <cmath>
#include <string>

#include "ops/base/once_differentiable.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::ops {

using kernels::LawId;
using kernels::View;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

template <class T>
void forward_kernel(int law, const Tensor& F, const Tensor& packed, double dt,
                    const Tensor& F_proj) {
  const auto& entry = kernels::law_table<T>().laws[law];
  const auto parameters = law_parameters<T>(packed);
  const View<const T> f = matrix_view<T>(F);
  const View<T> projected = mutable_matrix_view<T>(F_proj);
  for_each_block(F.size(0), [&](std::ptrdiff_t p, std::ptrdiff_t count) {
    entry.project(count, parameters, T(dt), f.from(p), projected.from(p));
  });
}

template <class T>
Tensor backward_kernel(int law, const Tensor& F, const Tensor& packed, double dt,
                       const Tensor& grad, const Tensor& grad_F, bool parameters_too) {
  const auto& entry = kernels::law_table<T>().laws[law];
  const auto parameters = law_parameters<T>(packed);
  const View<const T> f = matrix_view<T>(F), g = matrix_view<T>(grad);
  const View<T> gf = mutable_matrix_view<T>(grad_F);
  return sum_over_blocks<T>(
      F.size(0), packed, parameters_too,
      [&](std::ptrdiff_t p, std::ptrdiff_t count, kernels::LawParameters<T>* share) {
        entry.project_adjoint(count, parameters, T(dt), f.from(p), g.from(p), gf.from(p), share);
      });
}

class ReturnMappingFunction : public torch::autograd::Function<ReturnMappingFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& F, const Tensor& packed, int64_t law,
                        double dt) {
    const Tensor f = F.contiguous();
    const Tensor F_proj = torch::empty_like(f);
    for_real_type(f.scalar_type(), [&](auto real) {
      forward_kernel<decltype(real)>(int(law), f, packed, dt, F_proj);
    });
    ctx->save_for_backward({f, packed});
    ctx->saved_data["law"] = law;
    ctx->saved_data["dt"] = dt;
    ctx->set_materialize_grads(false);
    return F_proj;
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    if (!grad[0].defined()) return {Tensor(), Tensor(), Tensor(), Tensor()};
    const auto saved = ctx->get_saved_variables();
    const Tensor& F = saved[0];
    const int law = int(ctx->saved_data["law"].toInt());
    const double dt = ctx->saved_data["dt"].toDouble();
    const Tensor g = grad[0].contiguous();
    Tensor grad_F;
    if (ctx->needs_input_grad(0)) grad_F = torch::empty_like(F);
    const bool parameters_too = ctx->needs_input_grad(1);
    Tensor grad_packed;
    for_real_type(F.scalar_type(), [&](auto real) {
      grad_packed =
          backward_kernel<decltype(real)>(law, F, saved[1], dt, g, grad_F, parameters_too);
    });
    return once_differentiable("return_mapping", {grad_F, grad_packed, Tensor(), Tensor()});
  }
};

}  // namespace

Tensor return_mapping(LawId law, const Tensor& F, const Material& material, double dt) {
  check_matrices("return_mapping", "F", F);
  if (!(std::isfinite(dt) && dt >= 0))
    throw Error("return_mapping: dt: expected a finite number >= 0, found " + std::to_string(dt));
  const Tensor packed = pack_material("return_mapping", law, material);
  return ReturnMappingFunction::apply(F, packed, int64_t(law), dt);
}

}  // namespace uniphy::ops
