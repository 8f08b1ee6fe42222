#include "ops/mpm/p2g.hpp"

#include "ops/base/once_differentiable.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/mpm/transfers.hpp"
#include "ops/mpm/saved_grid.hpp"

namespace uniphy::ops {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

template <class T>
kernels::ParticleArrays<T> arrays(const variable_list& p) {
  return {p[0].size(0),       p[0].data_ptr<T>(), p[1].data_ptr<T>(), p[2].data_ptr<T>(),
          p[3].data_ptr<T>(), p[4].data_ptr<T>(), p[5].data_ptr<T>()};
}

class P2gFunction : public torch::autograd::Function<P2gFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& x, const Tensor& v, const Tensor& C,
                        const Tensor& tau, const Tensor& mass, const Tensor& volume,
                        const kernels::GridSettings& settings) {
    const variable_list inputs{x, v, C, tau, mass, volume};
    const std::int64_t n = settings.n;
    const Tensor grid = torch::empty({n, n, n, 4}, x.options());
    for_real_type(x.scalar_type(), [&](auto real) {
      using T = decltype(real);
      kernels::p2g<T>(settings, arrays<T>(inputs), grid.data_ptr<T>());
    });
    ctx->save_for_backward(inputs);
    save_grid(ctx, settings);
    ctx->set_materialize_grads(false);
    return grid;
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad_out) {
    variable_list grad(7);
    if (!grad_out[0].defined()) return grad;
    const variable_list inputs = ctx->get_saved_variables();
    const kernels::GridSettings settings = saved_grid(ctx);
    for (int i = 0; i < 6; ++i) {
      if (ctx->needs_input_grad(i)) grad[i] = torch::empty_like(inputs[i]);
    }
    for_real_type(inputs[0].scalar_type(), [&](auto real) {
      using T = decltype(real);
      const auto to = [&](int i) { return grad[i].defined() ? grad[i].data_ptr<T>() : nullptr; };
      kernels::p2g_adjoint<T>(settings, arrays<T>(inputs), gradient_data<T>(grad_out[0]),
                              {to(0), to(1), to(2), to(3), to(4), to(5)});
    });
    return once_differentiable("p2g", std::move(grad));
  }
};

}  // namespace

Tensor p2g(const Tensor& x, const Tensor& v, const Tensor& C, const Tensor& tau, const Tensor& mass,
           const Tensor& volume, const kernels::GridSettings& settings) {
  settings.check();
  const auto type = real_type("p2g", "x", x);
  const Tensor positions = checked("p2g", "x", x, type, {kAnySize, 3});
  const std::int64_t P = x.size(0);
  return P2gFunction::apply(
      positions, checked("p2g", "v", v, type, {P, 3}), checked("p2g", "C", C, type, {P, 3, 3}),
      checked("p2g", "tau", tau, type, {P, 3, 3}), checked("p2g", "mass", mass, type, {P}),
      checked("p2g", "volume", volume, type, {P}), settings);
}

}  // namespace uniphy::ops
