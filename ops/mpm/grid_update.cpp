#include "ops/mpm/grid_update.hpp"

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

class GridUpdateFunction : public torch::autograd::Function<GridUpdateFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& grid,
                        const kernels::GridSettings& settings) {
    const std::int64_t n = settings.n;
    const Tensor velocity = torch::empty({n, n, n, 3}, grid.options());
    for_real_type(grid.scalar_type(), [&](auto real) {
      using T = decltype(real);
      kernels::grid_update<T>(settings, grid.data_ptr<T>(), velocity.data_ptr<T>());
    });
    ctx->save_for_backward({grid, velocity});
    save_grid(ctx, settings);
    ctx->set_materialize_grads(false);
    return velocity;
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad_out) {
    if (!grad_out[0].defined()) return {Tensor(), Tensor()};
    const variable_list saved = ctx->get_saved_variables();
    const kernels::GridSettings settings = saved_grid(ctx);
    const Tensor grad = torch::empty_like(saved[0]);
    for_real_type(grad.scalar_type(), [&](auto real) {
      using T = decltype(real);
      kernels::grid_update_adjoint<T>(settings, saved[0].data_ptr<T>(), saved[1].data_ptr<T>(),
                                      gradient_data<T>(grad_out[0]), grad.data_ptr<T>());
    });
    return once_differentiable("grid_update", {grad, Tensor()});
  }
};

}  // namespace

Tensor grid_update(const Tensor& grid, const kernels::GridSettings& settings) {
  settings.check();
  const std::int64_t n = settings.n;
  const auto type = real_type("grid_update", "grid", grid);
  return GridUpdateFunction::apply(checked("grid_update", "grid", grid, type, {n, n, n, 4}),
                                   settings);
}

}  // namespace uniphy::ops
