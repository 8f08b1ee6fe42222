#include "ops/reference/mpm_step.hpp"

#include "ops/base/torch.hpp"
#include "ops/reference/g2p.hpp"
#include "ops/reference/grid_update.hpp"
#include "ops/reference/p2g.hpp"

namespace uniphy::ops::reference {

using torch::Tensor;

MpmState mpm_step(const MpmState& state, const Tensor& mass, const Tensor& volume,
                  const TensorLaw& law, const kernels::GridSettings& settings) {
  const Tensor F_trial = state.F + settings.dt * torch::matmul(state.C, state.F);
  const auto [F, tau] = law(F_trial, state.C);
  const Tensor grid = p2g(state.x, state.v, state.C, tau, mass, volume, settings);
  const G2p next = g2p(state.x, grid_update(grid, settings), settings);
  return {next.x, next.v, next.C, F};
}

}  // namespace uniphy::ops::reference
