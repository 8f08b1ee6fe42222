// Gradients of the learned law's op by the numbers of its networks, and what it keeps of them.

#include <gtest/gtest.h>
#include <omp.h>

#include "ops/base/torch.hpp"
#include "tests/ops/learned/learned_law_op.hpp"

namespace uniphy::ops {
namespace {

using kernels::Activation;
using kernels::LawForm;
using testing::generic_deformations;
using testing::relative;
using torch::Tensor;

class LearnedLawWeights : public LearnedLawOp {};

/// Gradients by the numbers of both networks, as in gradients().
std::vector<Tensor> weight_gradients(const LearnedNetworks& w, const Tensor& F, const Tensor& C,
                                     const Tensor& z) {
  LearnedNetworks leaf = w;
  leaf.projection.numbers = w.projection.numbers.detach().clone().requires_grad_();
  leaf.stress.numbers = w.stress.numbers.detach().clone().requires_grad_();
  const LawOutput out = learned_law(leaf, F, C, z);
  torch::manual_seed(5);
  const Tensor G = torch::randn(F.sizes(), torch::kFloat64).to(F.scalar_type());
  const Tensor S = torch::randn(F.sizes(), torch::kFloat64).to(F.scalar_type());
  const Tensor loss = (G * out.F_proj).sum() + (S * out.tau).sum() / kStressUnit;
  return torch::autograd::grad({loss}, {leaf.projection.numbers, leaf.stress.numbers});
}

/// The same networks with nothing but z in the first layers of those named.
LearnedNetworks blind(const LearnedNetworks& w, bool projection, bool stress) {
  LearnedNetworks r = w;
  const kernels::NetworkShape shape = kernels::network_shape(w.form);
  const auto clear = [](FlatLayers& layers, int features) {
    layers.numbers = layers.numbers.clone();
    layers_of(layers)[0].weight.narrow(1, 0, features).zero_();
  };
  if (projection) clear(r.projection, shape.projection_in);
  if (stress) clear(r.stress, shape.stress_in);
  r.cache = make_kernel_weights_cache();
  return r;
}

void expect_weight_gradients(const LearnedNetworks& w, const Tensor& every_F, const Tensor& every_C,
                             const Tensor& z) {
  const torch::NoGradGuard guard;
  torch::manual_seed(5);
  Tensor G = torch::randn(every_F.sizes(), torch::kFloat64);
  Tensor S = torch::randn(every_F.sizes(), torch::kFloat64);
  Tensor F = every_F, C = every_C;
  for (int repeat = 0; repeat < 3; ++repeat) {
    const Tensor of_projection = torch::randn_like(w.projection.numbers);
    const Tensor of_stress = torch::randn_like(w.stress.numbers);
    for (const bool projection : {true, false}) {
      SCOPED_TRACE(projection ? "projection" : "stress");
      const auto losses = [&](double step) {
        LearnedNetworks moved = w;
        FlatLayers& layers = projection ? moved.projection : moved.stress;
        layers.numbers = layers.numbers + step * (projection ? of_projection : of_stress);
        const LawOutput out = learned_law(moved, F, C, z);
        return ((G * out.F_proj) + (S * out.tau) / kStressUnit).sum({1, 2});  // [P]
      };
      const auto difference = [&](double h) {
        return (8 * (losses(h) - losses(-h)) - (losses(2 * h) - losses(-2 * h))) / (12 * h);
      };
      const Tensor fine = difference(1e-5), coarse = difference(3e-5);
      // Particles with a kink of the caps in the stencil are left out, and few may be.
      const Tensor smooth = (fine - coarse).abs() <= 1e-6 * (fine.abs() + 1e-2);
      EXPECT_GE(smooth.sum().item<int64_t>(), fine.numel() * 9 / 10);
      const Tensor weight = smooth.to(torch::kFloat64).view({-1, 1, 1});
      LearnedNetworks leaf = w;
      leaf.projection.numbers = w.projection.numbers.clone().requires_grad_();
      leaf.stress.numbers = w.stress.numbers.clone().requires_grad_();
      const torch::AutoGradMode on(true);
      const LawOutput out = learned_law(leaf, F, C, z);
      const Tensor loss = (weight * (G * out.F_proj + S * out.tau / kStressUnit)).sum();
      const auto g = torch::autograd::grad({loss}, {leaf.projection.numbers, leaf.stress.numbers});
      const double found = projection ? (g[0] * of_projection).sum().item<double>()
                                      : (g[1] * of_stress).sum().item<double>();
      const double expected = fine.masked_select(smooth).sum().item<double>();
      EXPECT_NE(expected, 0);
      EXPECT_NEAR(found, expected, 1e-6 * fine.masked_select(smooth).norm().item<double>());
    }
  }
}

TEST_P(LearnedLawWeights, GradientsMatchCentralDifferences) {
  const LearnedNetworks w = networks();
  const Tensor F = generic_deformations(300, 0.3, 6), C = rates(F), z = latent();
  expect_weight_gradients(w, F, C, z);
  if (form() == LawForm::published) return;
  // Networks of z alone: their weights of the state features are zero, the gradients are not.
  for (const bool both : {false, true}) {
    SCOPED_TRACE(both ? "both of z alone" : "projection of z alone");
    expect_weight_gradients(blind(w, true, both), F, C, z);
  }
}

TEST_P(LearnedLawWeights, GradientsHaveTheSameBitsTogetherApartAndOnEveryThreadCount) {
  const LearnedNetworks w = networks();
  const Tensor F = generic_deformations(3000, 0.2, 12).requires_grad_();
  const Tensor C = rates(F).requires_grad_(), z = latent().requires_grad_();
  LearnedNetworks leaf = w;
  leaf.projection.numbers = w.projection.numbers.clone().requires_grad_();
  leaf.stress.numbers = w.stress.numbers.clone().requires_grad_();
  const auto run = [&](const std::vector<Tensor>& leaves) {
    const LawOutput out = learned_law(leaf, F, C, z);
    return torch::autograd::grad({out.F_proj.square().sum() + out.tau.sum() / kStressUnit}, leaves);
  };
  const std::vector<Tensor> all{F, C, z, leaf.projection.numbers, leaf.stress.numbers};
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const auto one = run(all);
  omp_set_num_threads(2);
  const auto two = run(all);
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_TRUE(torch::equal(one[k], two[k])) << k;
    EXPECT_TRUE(torch::equal(run({all[k]})[0], two[k])) << k;
  }
  omp_set_num_threads(threads);
}

TEST_P(LearnedLawWeights, GradientsOfTheHalvesAreThoseOfTheWhole) {
  const LearnedNetworks w = networks();
  const Tensor F = generic_deformations(70, 0.3, 8), C = rates(F), z = latent();
  LearnedNetworks leaf = w;
  leaf.projection.numbers = w.projection.numbers.clone().requires_grad_();
  leaf.stress.numbers = w.stress.numbers.clone().requires_grad_();
  const Tensor F_proj = learned_project(leaf, F, z), tau = learned_stress(leaf, F_proj, C, z);
  torch::manual_seed(5);
  const Tensor G = torch::randn(F.sizes(), torch::kFloat64);
  const Tensor S = torch::randn(F.sizes(), torch::kFloat64);
  const auto halves = torch::autograd::grad({(G * F_proj).sum() + (S * tau).sum() / kStressUnit},
                                            {leaf.projection.numbers, leaf.stress.numbers});
  const auto whole = weight_gradients(w, F, C, z);
  for (int k : {0, 1})
    EXPECT_LE(relative(halves[k], whole[k]), form() == LawForm::published ? 1e-7 : 1e-10) << k;
  // What one half does not use stays undefined.
  const auto unused =
      torch::autograd::grad({learned_stress(leaf, F, C, z).sum()},
                            {leaf.projection.numbers, leaf.stress.numbers}, {}, c10::nullopt, false,
                            /*allow_unused=*/true);
  EXPECT_FALSE(unused[0].defined());
  EXPECT_TRUE(unused[1].defined());
  EXPECT_FALSE(learned_law(w, F, C, z).tau.requires_grad());
  const torch::NoGradGuard off;
  EXPECT_FALSE(learned_law(leaf, F, C, z).tau.requires_grad());
}

INSTANTIATE_TEST_SUITE_P(All, LearnedLawWeights, learned_law_cases(), learned_law_case);

TEST(LearnedLawWeightsCache, SeesEveryChangeOfTheNumbers) {
  const LearnedNetworks w = to_networks(
      testing::random_weights(LawForm::isotropic, 4, 8, 1, Activation::silu, 1), torch::kFloat64);
  const Tensor F = generic_deformations(5, 0.2, 3), C = torch::zeros_like(F);
  const Tensor z = torch::zeros({4}, torch::kFloat64);
  EXPECT_EQ(kernel_weights(w), kernel_weights(w));
  EXPECT_EQ(kernel_weights(w)->packed<double>(), kernel_weights(w)->packed<double>());
  const auto before = kernel_weights(w);
  const Tensor tau = learned_law(w, F, C, z).tau;
  w.stress.numbers.data_ptr<double>()[w.stress.numbers.numel() - 8] += 1;  // counts no version
  EXPECT_NE(kernel_weights(w), before);
  EXPECT_FALSE(torch::equal(learned_law(w, F, C, z).tau, tau));
  w.stress.numbers.data_ptr<double>()[w.stress.numbers.numel() - 8] -= 1;
  EXPECT_LE(relative(learned_law(w, F, C, z).tau, tau), 1e-12);
}

}  // namespace
}  // namespace uniphy::ops
