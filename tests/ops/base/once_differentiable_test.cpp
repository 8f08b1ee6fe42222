// A second derivative is refused by every op, and never silently zero.

#include "ops/base/once_differentiable.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <ostream>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/laws/kirchhoff_stress.hpp"
#include "ops/laws/return_mapping.hpp"
#include "ops/learned/learned_law.hpp"
#include "ops/mlp/mlp.hpp"
#include "ops/mpm/g2p.hpp"
#include "ops/mpm/grid_update.hpp"
#include "ops/mpm/p2g.hpp"
#include "ops/rollout/rollout.hpp"
#include "ops/spectral/svd3.hpp"
#include "tests/support/network_cases.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::ops {
namespace {

using torch::Tensor;

constexpr std::int64_t kParticles = 4;

kernels::GridSettings grid_settings() {
  kernels::GridSettings grid;
  grid.n = 12;
  grid.dt = 1e-3;
  return grid;
}

struct OpCase {
  const char* name;
  int rank;  ///< 3: [P, 3, 3], 2: [P, 3], 4: a grid
  std::function<Tensor(const Tensor&)> op;
};
void PrintTo(const OpCase& c, std::ostream* out) { *out << c.name; }

Tensor matrices() {
  return torch::eye(3, torch::kFloat64).expand({kParticles, 3, 3}) +
         0.1 * torch::randn({kParticles, 3, 3}, torch::kFloat64);
}
Tensor positions() { return 0.4 + 0.2 * torch::rand({kParticles, 3}, torch::kFloat64); }
Tensor ones(double value) { return torch::full({kParticles}, value, torch::kFloat64); }
Tensor zeros3() { return torch::zeros({kParticles, 3, 3}, torch::kFloat64); }

Material elastic() {
  Material m;
  m.mu = Parameter(1e3);
  m.lambda = Parameter(2e3);
  return m;
}

Tensor rolled_out(const Tensor& v) {
  RolloutBody body;
  body.end = kParticles;
  body.law.mu = body.law.lambda = 1e3;
  RolloutSettings settings;
  settings.grid = grid_settings();
  settings.steps = 3;
  return rollout(positions(), v, {}, {}, ones(1e-3), ones(1e-6), {body}, settings).x;
}

class OnceDifferentiable : public ::testing::TestWithParam<OpCase> {};
INSTANTIATE_TEST_SUITE_P(
    Ops, OnceDifferentiable,
    ::testing::Values(
        OpCase{"svd3", 3, [](const Tensor& F) { return svd3(F).sigma; }},
        OpCase{"return_mapping", 3,
               [](const Tensor& F) {
                 Material m = elastic();
                 m.tau_y = Parameter(1.0);
                 return return_mapping(kernels::LawId::plasticine, F, m, 1e-3);
               }},
        OpCase{"kirchhoff_stress", 3,
               [](const Tensor& F) {
                 return kirchhoff_stress(kernels::LawId::elastic, F, zeros3(), elastic());
               }},
        OpCase{"learned_law", 3,
               [](const Tensor& F) {
                 const LearnedNetworks networks =
                     to_networks(testing::random_weights(kernels::LawForm::isotropic, 5, 20, 2,
                                                         kernels::Activation::silu, 7),
                                 torch::kFloat64);
                 return learned_law(networks, F, zeros3(), torch::zeros({5}, torch::kFloat64)).tau;
               }},
        OpCase{"mlp", 2,
               [](const Tensor& x) {
                 return mlp(x, testing::network_layers({3, 8, 2}, torch::kFloat64),
                            kernels::Activation::silu);
               }},
        OpCase{"p2g", 2,
               [](const Tensor& v) {
                 return p2g(positions(), v, zeros3(), zeros3(), ones(1e-3), ones(1e-6),
                            grid_settings());
               }},
        OpCase{"grid_update", 4,
               [](const Tensor& grid) { return grid_update(grid, grid_settings()); }},
        OpCase{"g2p", 2,
               [](const Tensor& x) {
                 return g2p(0.4 + 0.02 * x, torch::rand({12, 12, 12, 3}, torch::kFloat64),
                            grid_settings())
                     .v;
               }},
        OpCase{"rollout", 2, rolled_out}),
    [](const auto& info) { return std::string(info.param.name); });

TEST_P(OnceDifferentiable, ASecondDerivativeIsRefused) {
  torch::manual_seed(1);
  const OpCase& c = GetParam();
  const Tensor x = (c.rank == 3   ? matrices()
                    : c.rank == 2 ? torch::rand({kParticles, 3}, torch::kFloat64)
                                  : 1 + torch::rand({12, 12, 12, 4}, torch::kFloat64))
                       .requires_grad_();
  const Tensor loss = c.op(x).pow(2).sum() + x.pow(3).sum();
  try {
    torch::autograd::grad({loss}, {x}, {}, true, /*create_graph=*/true);
    FAIL() << "a second derivative";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("is differentiable once"));
  }
  EXPECT_TRUE(torch::autograd::grad({loss}, {x})[0].isfinite().all().item<bool>());
}

}  // namespace
}  // namespace uniphy::ops
