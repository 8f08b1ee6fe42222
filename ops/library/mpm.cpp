#include <torch/library.h>

#include <string>
#include <tuple>

#include "ops/base/torch.hpp"
#include "ops/library/arguments.hpp"
#include "ops/library/library.hpp"
#include "ops/mpm/g2p.hpp"
#include "ops/mpm/grid_update.hpp"
#include "ops/mpm/p2g.hpp"

// The parts of an MPM step.

namespace uniphy::ops {

using torch::Tensor;

namespace {

Tensor p2g_op(const Tensor& x, const Tensor& v, const Tensor& C, const Tensor& tau,
              const Tensor& mass, const Tensor& volume, std::int64_t n, double dt,
              at::ArrayRef<double> gravity, const std::string& walls, std::int64_t bound) {
  return p2g(x, v, C, tau, mass, volume, grid_settings("p2g", n, dt, gravity, walls, bound));
}

Tensor grid_update_op(const Tensor& grid, std::int64_t n, double dt, at::ArrayRef<double> gravity,
                      const std::string& walls, std::int64_t bound) {
  return grid_update(grid, grid_settings("grid_update", n, dt, gravity, walls, bound));
}

std::tuple<Tensor, Tensor, Tensor> g2p_op(const Tensor& x, const Tensor& velocity, std::int64_t n,
                                          double dt, at::ArrayRef<double> gravity,
                                          const std::string& walls, std::int64_t bound) {
  const G2p r = g2p(x, velocity, grid_settings("g2p", n, dt, gravity, walls, bound));
  return {r.x, r.v, r.C};
}

}  // namespace

void define_mpm(torch::Library& library) {
  const std::string grid = kGridArguments;
  // x [P, 3] m, v [P, 3] m/s, C [P, 3, 3] 1/s, tau [P, 3, 3] Pa, mass [P] kg, volume [P] m³ →
  // momentum (kg m/s) and mass (kg) of the nodes [n, n, n, 4]: ops/mpm/p2g.hpp.
  library.def(("p2g(Tensor x, Tensor v, Tensor C, Tensor tau, Tensor mass, Tensor volume, *, " +
               grid + ") -> Tensor")
                  .c_str(),
              &p2g_op);
  // That grid → velocity [n, n, n, 3] m/s: ops/mpm/grid_update.hpp.
  library.def(("grid_update(Tensor grid, *, " + grid + ") -> Tensor").c_str(), &grid_update_op);
  // x [P, 3] m, velocity [n, n, n, 3] m/s → new x, v, C: ops/mpm/g2p.hpp. Every op of the step
  // takes the whole grid, so that one dictionary serves them all.
  library.def(("g2p(Tensor x, Tensor velocity, *, " + grid +
               ") -> (Tensor x_next, Tensor v_next, Tensor C_next)")
                  .c_str(),
              &g2p_op);
}

}  // namespace uniphy::ops
