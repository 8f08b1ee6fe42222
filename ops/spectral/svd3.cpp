#include "ops/spectral/svd3.hpp"

#include "ops/base/matrices.hpp"
#include "ops/base/once_differentiable.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/laws/law_table.hpp"

namespace uniphy::ops {

using kernels::View;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

template <class T>
View<const T> vector_view(const Tensor& t) {
  return {t.defined() ? t.data_ptr<T>() : nullptr, 3, 1};
}

template <class T>
void forward_kernel(const Tensor& F, const Tensor& U, const Tensor& sigma, const Tensor& Vh) {
  const auto& table = kernels::law_table<T>();
  const View<const T> f = matrix_view<T>(F);
  const View<T> u = mutable_matrix_view<T>(U), v = mutable_matrix_view<T>(Vh);
  const View<T> s{sigma.data_ptr<T>(), 3, 1};
  for_each_block(F.size(0), [&](std::ptrdiff_t p, std::ptrdiff_t count) {
    table.svd3(count, f.from(p), u.from(p), s.from(p), v.from(p));
  });
}

template <class T>
void backward_kernel(const Tensor& U, const Tensor& sigma, const Tensor& Vh, const Tensor& grad_U,
                     const Tensor& grad_sigma, const Tensor& grad_Vh, const Tensor& grad_F) {
  const auto& table = kernels::law_table<T>();
  const View<const T> u = matrix_view<T>(U), s = vector_view<T>(sigma), v = matrix_view<T>(Vh);
  const View<const T> gu = matrix_view<T>(grad_U), gs = vector_view<T>(grad_sigma),
                      gv = matrix_view<T>(grad_Vh);
  const View<T> gf = mutable_matrix_view<T>(grad_F);
  for_each_block(U.size(0), [&](std::ptrdiff_t p, std::ptrdiff_t count) {
    table.svd3_adjoint(count, u.from(p), s.from(p), v.from(p), gu.from(p), gs.from(p), gv.from(p),
                       gf.from(p));
  });
}

class Svd3Function : public torch::autograd::Function<Svd3Function> {
 public:
  static variable_list forward(AutogradContext* ctx, const Tensor& F) {
    const Tensor f = F.contiguous();
    const Tensor U = torch::empty_like(f), Vh = torch::empty_like(f);
    const Tensor sigma = torch::empty({f.size(0), 3}, f.options());
    for_real_type(f.scalar_type(),
                  [&](auto real) { forward_kernel<decltype(real)>(f, U, sigma, Vh); });
    ctx->save_for_backward({U, sigma, Vh});
    ctx->set_materialize_grads(false);
    return {U, sigma, Vh};
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    bool any = false;
    for (Tensor& g : grad) {
      if (g.defined()) g = g.contiguous(), any = true;
    }
    if (!any || !ctx->needs_input_grad(0)) return {Tensor()};
    const auto saved = ctx->get_saved_variables();
    const Tensor grad_F = torch::empty_like(saved[0]);
    for_real_type(grad_F.scalar_type(), [&](auto real) {
      backward_kernel<decltype(real)>(saved[0], saved[1], saved[2], grad[0], grad[1], grad[2],
                                      grad_F);
    });
    return once_differentiable("svd3", {grad_F});
  }
};

}  // namespace

Svd3 svd3(const Tensor& F) {
  check_matrices("svd3", "F", F);
  const variable_list r = Svd3Function::apply(F);
  return {r[0], r[1], r[2]};
}

}  // namespace uniphy::ops
