#include "ops/laws/kirchhoff_stress.hpp"

#include "ops/base/once_differentiable.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"

namespace uniphy::ops {

using kernels::LawId;
using kernels::View;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

template <class T>
void forward_kernel(int law, const Tensor& F, const Tensor& C, const Tensor& packed,
                    const Tensor& tau) {
  const auto& entry = kernels::law_table<T>().laws[law];
  const auto parameters = law_parameters<T>(packed);
  const View<const T> f = matrix_view<T>(F), c = matrix_view<T>(C);
  const View<T> t = mutable_matrix_view<T>(tau);
  for_each_block(F.size(0), [&](std::ptrdiff_t p, std::ptrdiff_t count) {
    entry.stress(count, parameters, f.from(p), c.from(p), t.from(p));
  });
}

template <class T>
Tensor backward_kernel(int law, const Tensor& F, const Tensor& C, const Tensor& packed,
                       const Tensor& grad, const Tensor& grad_F, const Tensor& grad_C,
                       bool parameters_too) {
  const auto& entry = kernels::law_table<T>().laws[law];
  const auto parameters = law_parameters<T>(packed);
  const View<const T> f = matrix_view<T>(F), c = matrix_view<T>(C), g = matrix_view<T>(grad);
  const View<T> gf = mutable_matrix_view<T>(grad_F), gc = mutable_matrix_view<T>(grad_C);
  return sum_over_blocks<T>(
      F.size(0), packed, parameters_too,
      [&](std::ptrdiff_t p, std::ptrdiff_t count, kernels::LawParameters<T>* share) {
        entry.stress_adjoint(count, parameters, f.from(p), c.from(p), g.from(p), gf.from(p),
                             gc.from(p), share);
      });
}

class KirchhoffStressFunction : public torch::autograd::Function<KirchhoffStressFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& F, const Tensor& C,
                        const Tensor& packed, int64_t law) {
    const Tensor f = F.contiguous(), c = C.contiguous();
    const Tensor tau = torch::empty_like(f);
    for_real_type(f.scalar_type(),
                  [&](auto real) { forward_kernel<decltype(real)>(int(law), f, c, packed, tau); });
    ctx->save_for_backward({f, c, packed});
    ctx->saved_data["law"] = law;
    ctx->set_materialize_grads(false);
    return tau;
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    if (!grad[0].defined()) return {Tensor(), Tensor(), Tensor(), Tensor()};
    const auto saved = ctx->get_saved_variables();
    const Tensor &F = saved[0], &C = saved[1];
    const int law = int(ctx->saved_data["law"].toInt());
    const Tensor g = grad[0].contiguous();
    Tensor grad_F, grad_C;
    if (ctx->needs_input_grad(0)) grad_F = torch::empty_like(F);
    if (ctx->needs_input_grad(1)) grad_C = torch::zeros_like(C);  // the kernel adds to it
    const bool parameters_too = ctx->needs_input_grad(2);
    Tensor grad_packed;
    for_real_type(F.scalar_type(), [&](auto real) {
      grad_packed =
          backward_kernel<decltype(real)>(law, F, C, saved[2], g, grad_F, grad_C, parameters_too);
    });
    return once_differentiable("kirchhoff_stress", {grad_F, grad_C, grad_packed, Tensor()});
  }
};

}  // namespace

Tensor kirchhoff_stress(LawId law, const Tensor& F, const Tensor& C, const Material& material) {
  check_matrices("kirchhoff_stress", "F", F);
  const Tensor c = C.defined() ? C : torch::zeros_like(F).detach();
  check_like("kirchhoff_stress", "C", c, F);
  const Tensor packed = pack_material("kirchhoff_stress", law, material);
  return KirchhoffStressFunction::apply(F, c, packed, int64_t(law));
}

}  // namespace uniphy::ops
