// The learned law as a torch module and its latent codes.

#include "models/learned_law.hpp"

#include <ATen/CPUGeneratorImpl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "models/latent_codes.hpp"
#include "models/script_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/reference/learned_law.hpp"
#include "tests/support/error_of.hpp"

namespace uniphy::models {
namespace {

using kernels::Activation;
using kernels::LawForm;
using ::testing::HasSubstr;
using torch::Tensor;

double relative(const Tensor& a, const Tensor& b) {
  return (a - b).norm().item<double>() / b.norm().item<double>();
}

LearnedLawOptions options(LawForm form) {
  LearnedLawOptions o;
  o.form = form;
  o.activation = form == LawForm::published ? Activation::gelu : Activation::silu;
  o.latent_size = 5;
  o.hidden_layers = 2;
  o.width = 16;
  o.state_caps = o.state_moduli = true;
  return o;
}

LearnedLaw random_law(const LearnedLawOptions& o, std::uint64_t seed = 3) {
  torch::Generator generator = torch::make_generator<at::CPUGeneratorImpl>(seed);
  return LearnedLaw(o, generator);
}
/// The same numbers in float64.
LearnedLaw wide_law(const LearnedLawOptions& o) {
  return LearnedLaw(random_law(o)->weights(), torch::kFloat64);
}
Tensor random_code(std::int64_t size) {
  torch::manual_seed(2);
  return 0.4 * torch::randn({size}, torch::kFloat64);
}

class LearnedLawModule : public ::testing::TestWithParam<LawForm> {};

TEST_P(LearnedLawModule, IsTheLawOfTheReference) {
  const LearnedLaw law = wide_law(options(GetParam()));
  const Probe probe = probe_states(200, 1);
  const Tensor z = random_code(5);
  const torch::NoGradGuard guard;
  const Tensor F_proj = law->project(probe.F, z), tau = law->stress(F_proj, probe.C, z);
  EXPECT_LE(relative(F_proj, ops::reference::learned_project(law->networks(), probe.F, z)), 1e-13);
  EXPECT_LE(relative(tau, ops::reference::learned_stress(law->networks(), F_proj, probe.C, z)),
            1e-12);
  const ops::LawOutput both = law->evaluate(probe.F, probe.C, z);
  EXPECT_TRUE(torch::equal(both.F_proj, F_proj));
  EXPECT_LE(relative(both.tau, tau), 1e-12);
}

/// Along a random direction of each parameter, against central differences.
TEST_P(LearnedLawModule, GradientsReachEveryWeight) {
  const LearnedLaw law = wide_law(options(GetParam()));
  const Probe probe = probe_states(30, 4);
  // In the isotropic form soft enough that the caps cut.
  Tensor z = random_code(5);
  z[1] = -1.0;
  const Tensor G = torch::randn_like(probe.F), S = torch::randn_like(probe.F);
  const auto loss = [&] {
    const Tensor F_proj = law->project(probe.F, z);
    return (G * F_proj).sum() + 1e-4 * (S * law->stress(F_proj, probe.C, z)).sum();
  };
  loss().backward();
  const torch::NoGradGuard guard;
  for (const auto& p : law->named_parameters()) {
    SCOPED_TRACE(p.key());
    Tensor weight = p.value();
    ASSERT_TRUE(weight.grad().defined());
    EXPECT_GT((weight.grad() != 0).sum().item<std::int64_t>(), weight.numel() / 2);
    const Tensor direction = torch::randn_like(weight), kept = weight.clone();
    const auto at = [&](double s) {
      weight.copy_(kept + s * direction);
      const double value = loss().item<double>();
      weight.copy_(kept);
      return value;
    };
    const double h = 1e-5;
    const double expected = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
    const double value = (weight.grad() * direction).sum().item<double>();
    EXPECT_NEAR(value, expected, 1e-6 * std::abs(expected));
  }
}

TEST_P(LearnedLawModule, ItsParametersAreTheNumbersOfTheNetworks) {
  const LearnedLaw law = random_law(options(GetParam()));
  const auto parameters = law->named_parameters();
  ASSERT_EQ(parameters.size(), 2u);
  EXPECT_EQ(law->parameter_count(),
            parameters["projection"].numel() + parameters["stress"].numel());
  {
    const torch::NoGradGuard guard;
    for (const auto& p : parameters) {
      EXPECT_TRUE(p.value().requires_grad());
      p.value().fill_(0.25);
    }
  }
  const kernels::LearnedLawWeights w = law->weights();
  for (const kernels::MlpWeights& network : {w.projection, w.stress})
    for (const auto& layer : network.layers)
      for (const auto& numbers : {layer.weight, layer.bias})
        EXPECT_EQ(numbers, std::vector<double>(numbers.size(), 0.25));
}

TEST_P(LearnedLawModule, AFrozenLawSharesTheNumbersAndAsksForNoGradient) {
  const LearnedLaw law = random_law(options(GetParam()));
  const LearnedLaw frozen = law->frozen();
  for (const Tensor& p : frozen->parameters()) EXPECT_FALSE(p.requires_grad());
  const torch::NoGradGuard guard;
  law->parameters()[1].mul_(2);
  for (std::size_t k = 0; k < 2; ++k)
    EXPECT_TRUE(torch::equal(law->parameters()[k], frozen->parameters()[k]));
  EXPECT_TRUE(law->parameters()[0].requires_grad());
}

TEST_P(LearnedLawModule, ItsWeightsGoOutAndComeBack) {
  const LearnedLaw law = random_law(options(GetParam()));
  const kernels::LearnedLawWeights w = law->weights();
  EXPECT_NO_THROW(w.check());
  const LearnedLaw again(w);
  const auto a = law->named_parameters(), b = again->named_parameters();
  ASSERT_EQ(a.size(), b.size());
  for (const auto& p : a) EXPECT_TRUE(torch::equal(p.value(), b[p.key()])) << p.key();
  EXPECT_EQ(again->form(), GetParam());
  EXPECT_EQ(again->activation(), law->activation());
  EXPECT_EQ(again->latent_size(), 5);
  kernels::LearnedLawWeights broken = w;
  broken.stress.layers[1].in += 1;
  EXPECT_THROW(LearnedLaw(broken, torch::kFloat64), Error);
}

TEST_P(LearnedLawModule, ItsGeneratorDecidesItsWeights) {
  const LearnedLawOptions o = options(GetParam());
  const LearnedLaw one = random_law(o), same = random_law(o), other = random_law(o, 4);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_TRUE(torch::equal(one->parameters()[k], same->parameters()[k]));
    EXPECT_FALSE(torch::equal(one->parameters()[k], other->parameters()[k]));
  }
}

/// Signals keep their size through the hidden layers; the last layer is small.
TEST_P(LearnedLawModule, ItsInitialLayersKeepTheVariance) {
  LearnedLawOptions o = options(GetParam());
  o.width = 64;
  const LearnedLaw law = random_law(o);
  const auto layers = ops::layers_of(law->networks().stress);
  ASSERT_EQ(layers.size(), 3u);
  const double expected[] = {1.0, 1.6, 0.3};
  for (std::size_t k = 0; k < 3; ++k) {
    const Tensor& weight = layers[k].weight;
    const double deviation = weight.std().item<double>() * std::sqrt(double(weight.size(1)));
    EXPECT_NEAR(deviation, expected[k], 0.1 * expected[k]) << k;
  }
}

TEST(LearnedLawModuleState, AnswersToTheStateWhereAskedTo) {
  for (const bool caps : {false, true}) {
    for (const bool moduli : {false, true}) {
      LearnedLawOptions o = options(LawForm::isotropic);
      o.state_caps = caps;
      o.state_moduli = moduli;
      const LearnedLaw law = random_law(o), again(law->weights());
      EXPECT_EQ(law->state_caps(), caps);
      EXPECT_EQ(law->state_moduli(), moduli);
      EXPECT_EQ(again->state_caps(), caps);
      EXPECT_EQ(again->state_moduli(), moduli);
    }
  }
}

TEST_P(LearnedLawModule, TakesAnySize) {
  for (const std::int64_t hidden : {0, 1, 3}) {
    for (const std::int64_t latent : {0, 1, 2, 7}) {
      LearnedLawOptions o = options(GetParam());
      o.latent_size = latent;
      o.hidden_layers = hidden;
      const LearnedLaw law = wide_law(o);
      const Probe probe = probe_states(3, 6);
      const Tensor z = random_code(latent);
      const torch::NoGradGuard guard;
      const Tensor F_proj = law->project(probe.F, z), tau = law->stress(F_proj, probe.C, z);
      EXPECT_LE(relative(F_proj, ops::reference::learned_project(law->networks(), probe.F, z)),
                1e-13);
      EXPECT_LE(relative(tau, ops::reference::learned_stress(law->networks(), F_proj, probe.C, z)),
                1e-12);
      EXPECT_EQ(law->project(probe.F.slice(0, 0, 0), z).size(0), 0);
    }
  }
}

TEST_P(LearnedLawModule, RefusesWhatDoesNotFit) {
  const LearnedLaw law = wide_law(options(GetParam()));
  const Tensor F = torch::eye(3, torch::kFloat64).repeat({2, 1, 1});
  const Tensor z = torch::zeros(5, torch::kFloat64);
  EXPECT_THAT(testing::error_of([&] { law->project(F[0], z); }),
              HasSubstr("learned law: F: expected"));
  EXPECT_THAT(testing::error_of([&] { law->project(F, torch::zeros(5)); }),
              HasSubstr("learned law: z: expected"));
  EXPECT_THAT(testing::error_of([&] { law->stress(F, F.slice(0, 1), z); }),
              HasSubstr("learned law: C: expected"));
  LearnedLawOptions o = options(GetParam());
  o.width = 0;
  EXPECT_EQ(testing::error_of([&] { random_law(o); }),
            "learned law: width: expected 1 or more units, found 0");
  o.hidden_layers = -2;
  EXPECT_EQ(testing::error_of([&] { random_law(o); }),
            "learned law: hidden_layers: expected 0 or more, found -2");
  o.latent_size = -1;
  EXPECT_EQ(testing::error_of([&] { random_law(o); }),
            "learned law: latent_size: expected 0 or more numbers, found -1");
}

INSTANTIATE_TEST_SUITE_P(Forms, LearnedLawModule,
                         ::testing::Values(LawForm::isotropic, LawForm::published),
                         [](const auto& info) { return kernels::form_name(info.param); });

TEST(LatentCodes, RefuseTablesOfDifferentLength) {
  EXPECT_EQ(testing::error_of([] {
              LatentCodes codes(torch::zeros({2, 4}), std::vector<std::string>{"sand", "elastic"},
                                std::vector<CodeParameters>{CodeParameters{}});
            }),
            "latent codes: parameters: expected 2 rows, one for each code, found 1");
  EXPECT_EQ(testing::error_of([] {
              LatentCodes codes(torch::zeros({1, 4}), std::vector<std::string>{},
                                std::vector<CodeParameters>{CodeParameters{}});
            }),
            "latent codes: materials: expected 1 rows, one for each code, found 0");
}

}  // namespace
}  // namespace uniphy::models
