// The learned law as a torch module, and the latent codes.

#include "models/learned_law.hpp"

#include <gtest/gtest.h>
#include <torch/torch.h>

#include <functional>
#include <string>

#include "models/latent_codes.hpp"
#include "models/script_check.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/learned/learned_law.hpp"

namespace uniphy::models {
namespace {

using kernels::Activation;
using kernels::LawForm;
using torch::Tensor;

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

double relative(const Tensor& a, const Tensor& b) {
  return (a - b).norm().item<double>() / b.norm().item<double>();
}

LearnedLawOptions options(LawForm form) {
  LearnedLawOptions o;
  o.form = form;
  o.activation = form == LawForm::published ? Activation::gelu : Activation::silu;
  o.latent_size = 5;
  o.projection_hidden = {24, 12};
  o.stress_hidden = {16, 20, 8};
  o.seed = 3;
  o.dtype = torch::kFloat64;
  return o;
}

class LearnedLawModule : public ::testing::TestWithParam<LawForm> {};

TEST_P(LearnedLawModule, RunsTheFormulasOfTheKernels) {
  LearnedLaw law(options(GetParam()));
  const Probe probe = probe_states(200, 1);
  torch::manual_seed(2);
  const Tensor z = 0.4 * torch::randn({5}, torch::kFloat64);
  const auto out =
      ops::learned_law(ops::to_networks(law->weights(), torch::kFloat64), probe.F, probe.C, z);
  const Tensor F_proj = law->project(probe.F, z);
  EXPECT_LE(relative(F_proj, out.F_proj), 1e-10);
  EXPECT_LE(relative(law->stress(F_proj, probe.C, z), out.tau), 1e-9);
}

TEST_P(LearnedLawModule, GradientsReachEveryWeight) {
  LearnedLaw law(options(GetParam()));
  const Probe probe = probe_states(30, 4);
  torch::manual_seed(5);
  // In the isotropic form soft enough that the caps cut.
  Tensor z = 0.4 * torch::randn({5}, torch::kFloat64);
  z[1] = -1.0;
  z.requires_grad_();
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
    EXPECT_GT(weight.grad().abs().max().item<double>(), 0);
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
    EXPECT_NEAR(value, expected, 1e-6 * (std::abs(expected) + 1e-3));
  }
}

TEST_P(LearnedLawModule, ItsWeightsGoOutAndComeBack) {
  LearnedLaw law(options(GetParam()));
  const kernels::LearnedLawWeights w = law->weights();
  EXPECT_NO_THROW(w.check());
  LearnedLaw again(w, torch::kFloat64);
  const auto a = law->named_parameters(), b = again->named_parameters();
  ASSERT_EQ(a.size(), b.size());
  for (const auto& p : a) EXPECT_TRUE(torch::equal(p.value(), b[p.key()])) << p.key();
  EXPECT_EQ(law->parameter_count(), again->parameter_count());
  kernels::LearnedLawWeights broken = w;
  broken.stress.layers[1].in += 1;
  EXPECT_THROW(LearnedLaw(broken, torch::kFloat64), Error);
}

TEST_P(LearnedLawModule, ItsSeedDecidesItsWeights) {
  LearnedLawOptions o = options(GetParam());
  LearnedLaw one(o), same(o);
  o.seed = 4;
  LearnedLaw other(o);
  EXPECT_TRUE(torch::equal(one->parameters()[0], same->parameters()[0]));
  EXPECT_FALSE(torch::equal(one->parameters()[0], other->parameters()[0]));
}

TEST_P(LearnedLawModule, TakesAnySizeAndALatentForEachParticle) {
  for (const bool hidden : {false, true}) {
    for (const std::int64_t latent : {0, 1, 2, 7}) {
      LearnedLawOptions o = options(GetParam());
      o.latent_size = latent;
      if (!hidden) o.projection_hidden = o.stress_hidden = {};
      LearnedLaw law(o);
      const Probe probe = probe_states(3, 6);
      const Tensor z = 0.3 * torch::randn({3, latent}, torch::kFloat64);
      const Tensor F_proj = law->project(probe.F, z), tau = law->stress(F_proj, probe.C, z);
      for (int p = 0; p < 3; ++p) {
        const auto one = [p](const Tensor& t) { return t.slice(0, p, p + 1); };
        const Tensor alone = law->project(one(probe.F), z[p]);
        EXPECT_LE(relative(F_proj[p], alone[0]), 1e-12);
        EXPECT_LE(relative(tau[p], law->stress(alone, one(probe.C), z[p])[0]), 1e-9);
      }
      EXPECT_EQ(law->project(probe.F.slice(0, 0, 0), z.slice(0, 0, 0)).size(0), 0);
    }
  }
}

TEST_P(LearnedLawModule, RefusesWhatDoesNotFit) {
  LearnedLaw law(options(GetParam()));
  const Tensor F = torch::eye(3, torch::kFloat64).repeat({2, 1, 1});
  const Tensor z = torch::zeros(5, torch::kFloat64);
  EXPECT_EQ(message_of([&] { law->project(F[0], z); }),
            "learned law: F: expected [P, 3, 3] Double, found [3, 3] Double");
  EXPECT_EQ(message_of([&] { law->project(F, torch::zeros(5)); }),
            "learned law: z: expected [5] or [2, 5] Double, found [5] Float");
  EXPECT_EQ(message_of([&] { law->stress(F, F.slice(0, 1), z); }),
            "learned law: C: expected [2, 3, 3] Double, found [1, 3, 3] Double");
  LearnedLawOptions o = options(GetParam());
  o.stress_hidden = {8, 0};
  EXPECT_EQ(message_of([&] { LearnedLaw{o}; }),
            "learned law: a hidden layer: expected 1 or more units, found 0");
  o.latent_size = -1;
  EXPECT_EQ(message_of([&] { LearnedLaw{o}; }),
            "learned law: latent_size: expected 0 or more numbers, found -1");
}

INSTANTIATE_TEST_SUITE_P(Forms, LearnedLawModule,
                         ::testing::Values(LawForm::isotropic, LawForm::published),
                         [](const auto& info) { return kernels::form_name(info.param); });

TEST(LatentCodes, GoThroughAModelFile) {
  MaterialParameters sand = no_parameters(), elastic = no_parameters();
  sand[0] = 1e5;
  sand[3] = 0.3;
  elastic[1] = 2e5;
  LatentCodes codes(4, std::vector<std::string>{"sand", "elastic", "sand"},
                    std::vector<MaterialParameters>{sand, elastic, sand}, 0.5, 11, torch::kFloat64);
  EXPECT_EQ(codes->size(), 3);
  EXPECT_GT(codes->z.std().item<double>(), 0.1);
  EXPECT_TRUE(torch::equal(codes->rows_of("sand"), torch::tensor({0, 2}, torch::kInt64)));
  EXPECT_TRUE(torch::equal(codes->codes(torch::tensor({2, 0}, torch::kInt64))[0], codes->code(2)));
  ModelFile file;
  file.weights.latent_size = 4;
  codes->store(file);
  LatentCodes again(file, torch::kFloat64);
  EXPECT_TRUE(torch::equal(again->z, codes->z));
  EXPECT_EQ(again->materials(), codes->materials());
  EXPECT_EQ(again->material_parameters()[1][1], 2e5);
  // Only the rows that a loss touches get a gradient.
  again->codes(torch::tensor({1}, torch::kInt64)).sum().backward();
  EXPECT_EQ(again->z.grad()[0].abs().sum().item<double>(), 0);
  EXPECT_EQ(again->z.grad()[1].sum().item<double>(), 4);
}

TEST(LatentCodes, RefuseTablesOfDifferentLength) {
  EXPECT_EQ(message_of([] {
              LatentCodes codes(4, std::vector<std::string>{"sand", "elastic"},
                                std::vector<MaterialParameters>{no_parameters()});
            }),
            "latent codes: parameters: expected 2 rows, one for each material, found 1");
  ModelFile file;
  file.weights.latent_size = 3;
  file.materials = {"sand"};
  file.parameters = {no_parameters()};
  file.latents = {1, 2};
  EXPECT_EQ(message_of([&] { LatentCodes{file}; }), "latent codes: expected 3 numbers, found 2");
}

}  // namespace
}  // namespace uniphy::models
