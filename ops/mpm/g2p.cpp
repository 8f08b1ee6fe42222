#include "ops/mpm/g2p.hpp"

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

class G2pFunction : public torch::autograd::Function<G2pFunction> {
 public:
  static variable_list forward(AutogradContext* ctx, const Tensor& x, const Tensor& velocity,
                               const kernels::GridSettings& settings) {
    const std::int64_t P = x.size(0);
    const Tensor x_out = torch::empty_like(x), v_out = torch::empty_like(x);
    const Tensor C_out = torch::empty({P, 3, 3}, x.options());
    for_real_type(x.scalar_type(), [&](auto real) {
      using T = decltype(real);
      kernels::g2p<T>(settings, P, x.data_ptr<T>(), velocity.data_ptr<T>(), x_out.data_ptr<T>(),
                      v_out.data_ptr<T>(), C_out.data_ptr<T>());
    });
    ctx->save_for_backward({x, velocity, v_out});
    save_grid(ctx, settings);
    ctx->set_materialize_grads(false);
    return {x_out, v_out, C_out};
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad_out) {
    Tensor grad_x, grad_velocity;
    if (grad_out[0].defined() || grad_out[1].defined() || grad_out[2].defined()) {
      const variable_list saved = ctx->get_saved_variables();
      const kernels::GridSettings settings = saved_grid(ctx);
      if (ctx->needs_input_grad(0)) grad_x = torch::empty_like(saved[0]);
      if (ctx->needs_input_grad(1)) grad_velocity = torch::empty_like(saved[1]);
      for_real_type(saved[0].scalar_type(), [&](auto real) {
        using T = decltype(real);
        const auto to = [](const Tensor& t) { return t.defined() ? t.data_ptr<T>() : nullptr; };
        kernels::g2p_adjoint<T>(settings, saved[0].size(0), saved[0].data_ptr<T>(),
                                saved[1].data_ptr<T>(), saved[2].data_ptr<T>(),
                                gradient_data<T>(grad_out[0]), gradient_data<T>(grad_out[1]),
                                gradient_data<T>(grad_out[2]), to(grad_x), to(grad_velocity));
      });
    }
    return once_differentiable("g2p", {grad_x, grad_velocity, Tensor()});
  }
};

}  // namespace

G2p g2p(const Tensor& x, const Tensor& velocity, const kernels::GridSettings& settings) {
  settings.check();
  const std::int64_t n = settings.n;
  const auto type = real_type("g2p", "x", x);
  const variable_list out =
      G2pFunction::apply(checked("g2p", "x", x, type, {kAnySize, 3}),
                         checked("g2p", "velocity", velocity, type, {n, n, n, 3}), settings);
  return {out[0], out[1], out[2]};
}

}  // namespace uniphy::ops
