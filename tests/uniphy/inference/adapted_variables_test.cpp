// What is free on each rung, and where the law's own numbers are fitted from.

#include "uniphy/inference/adapted_variables.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "ops/base/torch.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "uniphy/inference/term_split.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

struct Rungs {
  std::unique_ptr<const FitVariables> z = make_latent_variables(testing::readable_model());
  AdaptedVariables latent{*z, Rung::latent}, numbers{*z, Rung::numbers}, weights{*z, Rung::weights};
  Tensor start = torch::tensor(z->start(2), torch::kFloat64);
};

std::vector<double> last_bias(const kernels::MlpWeights& network) {
  return network.layers.back().bias;
}

TEST(AdaptedVariables, ANumberIsAddedToTheBiasOfItsOutput) {
  const Rungs r;
  EXPECT_EQ(r.latent.size(), 4);
  EXPECT_EQ(r.numbers.size(), 4 + kernels::kCapOutputs + kernels::kStressOutputs);
  Tensor u = r.numbers.widened(r.latent, r.start);
  u[4 + kernels::kCapSlope] = 0.3;
  u[4 + kernels::kCapOutputs + kernels::kShear] = -0.2;
  const kernels::LawDescription before = r.z->law(r.start), after = r.numbers.law(u);
  EXPECT_EQ(after.z, before.z);
  auto caps = last_bias(before.weights->projection), stress = last_bias(before.weights->stress);
  caps[kernels::kCapSlope] += 0.3;
  stress[kernels::kShear] -= 0.2;
  EXPECT_EQ(last_bias(after.weights->projection), caps);
  EXPECT_EQ(last_bias(after.weights->stress), stress);
  EXPECT_EQ(after.weights->stress.layers[0].weight, before.weights->stress.layers[0].weight);
  const Tensor moved = r.numbers.outputs(u) - r.latent.outputs(r.start);
  EXPECT_NEAR(moved[int(kernels::kCapOutputs) + kernels::kShear].item<double>(), -0.2, 1e-12);
  EXPECT_NEAR(moved.abs().sum().item<double>(), 0.5, 1e-12);
}

TEST(AdaptedVariables, ARungHasTheOneBelowInIt) {
  const Rungs r;
  Tensor u = r.numbers.widened(r.latent, r.start);
  u.slice(0, 4, u.numel()).fill_(0.1);
  const Tensor w = r.weights.widened(r.numbers, u);
  EXPECT_EQ(w.numel(), r.weights.size());
  const kernels::LawDescription a = r.numbers.law(u), b = r.weights.law(w);
  EXPECT_EQ(last_bias(a.weights->projection), last_bias(b.weights->projection));
  EXPECT_EQ(last_bias(a.weights->stress), last_bias(b.weights->stress));
  EXPECT_EQ(a.weights->stress.layers[0].weight, b.weights->stress.layers[0].weight);
  EXPECT_EQ(a.z, b.z);
}

TEST(AdaptedVariables, ThePullLeavesTheLawsOwnNumbersFree) {
  const Rungs r;
  EXPECT_FALSE(r.numbers.departure(torch::tensor(r.numbers.start(0), torch::kFloat64)).defined());
  Tensor u = r.numbers.widened(r.latent, r.start);
  u.slice(0, 4, u.numel()).fill_(0.1);
  Tensor w = r.weights.widened(r.numbers, u);
  EXPECT_EQ(r.weights.departure(w).item<double>(), 0);
  w[4] = 0.5;  // a weight of the first layer
  EXPECT_NEAR(r.weights.departure(w).item<double>(), 0.25, 1e-12);
  w.requires_grad_();
  r.weights.departure(w).backward();
  EXPECT_NEAR(w.grad()[4].item<double>(), 1, 1e-12);
}

TEST(AdaptedVariables, TheLeadingNumbersAreTheCodeAndTheLawsOwn) {
  const Rungs r;
  EXPECT_EQ(r.latent.leading().size(), std::size_t(r.latent.size()));
  EXPECT_EQ(r.numbers.leading().size(), std::size_t(r.numbers.size()));
  const std::vector<std::int64_t> leading = r.weights.leading();
  ASSERT_EQ(leading.size(), r.numbers.leading().size());
  // The last of them is the last bias of the stress network on both rungs.
  Tensor narrow = torch::zeros({r.numbers.size()}, torch::kFloat64);
  narrow[r.numbers.size() - 1] = 0.3;
  Tensor wide = torch::zeros({r.weights.size()}, torch::kFloat64);
  wide[leading.back()] = 0.3;
  EXPECT_TRUE(r.weights.widened(r.numbers, narrow).equal(wide));
}

TEST(TermSplit, LeavesTheStressToSecondOrder) {
  const Rungs r;
  const Tensor u = r.numbers.widened(r.latent, r.start);
  const auto moments = [&](const Tensor& point) {
    const Tensor out = r.numbers.outputs(point).slice(0, kernels::kCapOutputs);
    const auto at = [&](int k) { return out[k].item<double>(); };
    const double a1 = std::sinh(at(kernels::kShear)), a2 = std::sinh(at(kernels::kSecondShear));
    const double n1 = at(kernels::kShearExponent), n2 = at(kernels::kSecondExponent);
    return std::array<double, 3>{a1 + a2, a1 * n1 + a2 * n2, n1 - n2};
  };
  const auto before = moments(u);
  const std::vector<Tensor> split = split_terms(r.numbers, u);
  ASSERT_EQ(split.size(), 2u);
  for (int i = 0; i < 2; ++i) {
    const auto after = moments(split[i]);
    EXPECT_NEAR(after[0], before[0], 1e-12);
    EXPECT_NEAR(after[1], before[1], 1e-12);
    EXPECT_NEAR(after[2], i == 0 ? 1 : -1, 1e-12);
  }
}

TEST(TermSplit, ALawWithoutElasticShearHasNone) {
  const Rungs r;
  Tensor u = r.numbers.widened(r.latent, r.start);
  const Tensor shear = r.numbers.outputs(u)[int(kernels::kCapOutputs) + kernels::kShear];
  u[4 + kernels::kCapOutputs + kernels::kShear] -= shear.item<double>();
  EXPECT_TRUE(split_terms(r.numbers, u).empty());
}

}  // namespace
}  // namespace uniphy
