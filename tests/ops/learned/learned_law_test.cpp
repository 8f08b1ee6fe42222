// The learned law's op against its plain-tensor reference and against central differences.

#include "ops/reference/learned_law.hpp"

#include <gtest/gtest.h>
#include <omp.h>

#include "ops/base/torch.hpp"
#include "tests/ops/learned/learned_law_op.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/law_cases.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::ops {
namespace {

using kernels::Activation;
using kernels::LawForm;
using testing::generic_deformations;
using testing::relative;
using testing::tensor_of;
using torch::Tensor;

/// One tensor for each group of the gradient table, without the states whose singular values are
/// closer than `gap`.
std::vector<std::pair<std::string, Tensor>> grouped_deformations(double gap) {
  std::vector<std::pair<std::string, Tensor>> groups;
  std::vector<testing::Matrix> current;
  const auto cases = testing::deformation_cases();
  for (std::size_t k = 0; k < cases.size(); ++k) {
    const testing::Matrix& s = cases[k].sigma;
    if (s[0] - s[4] >= gap && s[4] - s[8] >= gap) current.push_back(cases[k].F);
    if (k + 1 == cases.size() || cases[k + 1].group != cases[k].group) {
      if (!current.empty()) groups.emplace_back(cases[k].group, tensor_of(current));
      current.clear();
    }
  }
  groups.emplace_back("generic", generic_deformations(150, 0.3, 3));
  groups.emplace_back("small strain", generic_deformations(150, 1e-4, 4));
  groups.emplace_back("F = I", torch::eye(3, torch::kFloat64).repeat({3, 1, 1}));
  return groups;
}

struct Gradients {
  Tensor F, C, z;
};
/// Of L = Σ G:F_proj + S:τ/unit with fixed G and S.
Gradients gradients(const LawOutput& out, const Tensor& F, const Tensor& C, const Tensor& z) {
  torch::manual_seed(5);
  const Tensor G = torch::randn(out.F_proj.sizes(), torch::kFloat64).to(F.scalar_type());
  const Tensor S = torch::randn(out.F_proj.sizes(), torch::kFloat64).to(F.scalar_type());
  const Tensor loss = (G * out.F_proj).sum() + (S * out.tau).sum() / kStressUnit;
  const auto g = torch::autograd::grad({loss}, {F, C, z});
  return {g[0], g[1], g[2]};
}

TEST_P(LearnedLawOp, FollowsItsReference) {
  const LearnedNetworks w = networks();
  const LearnedNetworks& reference_law = w;
  double largest = 0;
  // Where singular values meet, U and V are not unique and the published form has no one answer.
  const double gap = form() == LawForm::published ? 5e-5 : 0;
  for (const auto& [name, deformations] : grouped_deformations(gap)) {
    SCOPED_TRACE(name);
    const Tensor F = deformations.clone().requires_grad_();
    const Tensor C = rates(F).requires_grad_();
    const Tensor z = latent().requires_grad_();
    const LawOutput out = learned_law(w, F, C, z);
    LawOutput expected;
    expected.F_proj = reference::learned_project(reference_law, F, z);
    expected.tau = reference::learned_stress(reference_law, expected.F_proj, C, z);
    // The published form sees U and V, which rounding turns by eps/gap.
    const bool turns = form() == LawForm::published;
    EXPECT_LE(relative(out.F_proj, expected.F_proj), turns ? 1e-10 : 1e-12);
    EXPECT_LE(relative(out.tau, expected.tau), turns ? 3e-9 : 1e-11);
    const Gradients g = gradients(out, F, C, z), e = gradients(expected, F, C, z);
    EXPECT_LE(relative(g.F, e.F), turns ? 1e-6 : 1e-9);
    EXPECT_LE(relative(g.C, e.C), turns ? 1e-9 : 1e-10);
    EXPECT_LE(relative(g.z, e.z), turns ? 3e-9 : 1e-10);
    EXPECT_GT(e.F.norm().item<double>(), 0);
    EXPECT_GT(e.z.norm().item<double>(), 0);
    largest = std::max({largest, relative(g.F, e.F), relative(g.C, e.C), relative(g.z, e.z)});
  }
  RecordProperty("largest_gradient_difference", std::to_string(largest));
}

TEST_P(LearnedLawOp, GradientsMatchCentralDifferences) {
  const LearnedNetworks w = networks();
  const Tensor F = generic_deformations(40, 0.3, 6).requires_grad_();
  const Tensor C = rates(F).requires_grad_();
  const Tensor z = latent().requires_grad_();
  const Gradients g = gradients(learned_law(w, F, C, z), F, C, z);
  torch::manual_seed(5);
  const Tensor G = torch::randn(F.sizes(), torch::kFloat64);
  const Tensor S = torch::randn(F.sizes(), torch::kFloat64);
  const torch::NoGradGuard guard;
  const auto losses = [&](const Tensor& f, const Tensor& c, const Tensor& latent_code) {
    const LawOutput out = learned_law(w, f, c, latent_code);
    return ((G * out.F_proj) + (S * out.tau) / kStressUnit).sum({1, 2});  // [P]
  };
  // Fourth order, along a random direction of each argument, particle by particle. A kink of the
  // caps inside a stencil shows as two step sizes that disagree; few may.
  const auto compare = [&](const char* name, const Tensor& value, double h, const auto& along) {
    SCOPED_TRACE(name);
    const auto difference = [&](double step) {
      return (8 * (along(step) - along(-step)) - (along(2 * step) - along(-2 * step))) /
             (12 * step);
    };
    const Tensor fine = difference(h), coarse = difference(3 * h);
    const Tensor smooth = (fine - coarse).abs() <= 1e-6 * (fine.abs() + 1e-2);
    EXPECT_GE(smooth.sum().item<int64_t>(), fine.numel() * 9 / 10);
    EXPECT_LE(relative(value.masked_select(smooth), fine.masked_select(smooth)), 1e-6);
  };
  const Tensor dF = torch::randn_like(F), dC = torch::randn_like(C), dz = torch::randn_like(z);
  compare("F", (g.F * dF).sum({1, 2}), 1e-5, [&](double s) { return losses(F + s * dF, C, z); });
  compare("C", (g.C * dC).sum({1, 2}), 1e-3, [&](double s) { return losses(F, C + s * dC, z); });
  compare("z", (g.z * dz).sum().reshape({1}), 1e-6,
          [&](double s) { return losses(F, C, z + s * dz).sum().reshape({1}); });
}

TEST_P(LearnedLawOp, ItsTwoHalvesAreTheWhole) {
  const LearnedNetworks w = networks();
  const Tensor F = generic_deformations(70, 0.3, 8), C = rates(F), z = latent();
  const LawOutput out = learned_law(w, F, C, z);
  EXPECT_TRUE(torch::equal(learned_project(w, F, z), out.F_proj));
  // The stress of the whole comes from the projected singular values themselves.
  EXPECT_LE(relative(learned_stress(w, out.F_proj, C, z), out.tau), 1e-12);
  const Tensor f = F.clone().requires_grad_(), c = C.clone().requires_grad_();
  const Tensor code = z.clone().requires_grad_();
  LawOutput halves;
  halves.F_proj = learned_project(w, f, code);
  halves.tau = learned_stress(w, halves.F_proj, c, code);
  const Gradients split = gradients(halves, f, c, code);
  const Gradients whole = gradients(learned_law(w, f, c, code), f, c, code);
  EXPECT_LE(relative(split.F, whole.F), form() == LawForm::published ? 1e-7 : 1e-10);
  EXPECT_LE(relative(split.C, whole.C), 1e-10);
  EXPECT_LE(relative(split.z, whole.z), 1e-10);
}

TEST_P(LearnedLawOp, TakesEveryBatchAndLayout) {
  const LearnedNetworks w = networks();
  const Tensor F = generic_deformations(65, 0.2, 9), C = rates(F), z = latent();
  const LawOutput out = learned_law(w, F, C, z);
  for (const int64_t n : {0, 1, 2, 63, 64}) {
    const LawOutput part = learned_law(w, F.slice(0, 0, n), C.slice(0, 0, n), z);
    EXPECT_TRUE(torch::equal(part.F_proj, out.F_proj.slice(0, 0, n))) << n;
    EXPECT_TRUE(torch::equal(part.tau, out.tau.slice(0, 0, n))) << n;
  }
  const LawOutput strided = learned_law(w, F.mT().contiguous().mT(), C.mT().contiguous().mT(), z);
  EXPECT_TRUE(torch::equal(strided.tau, out.tau));
  Tensor empty = torch::zeros({0, 3, 3}, torch::kFloat64).requires_grad_();
  Tensor code = latent().requires_grad_();
  const auto g =
      torch::autograd::grad({learned_law(w, empty, empty, code).tau.sum()}, {empty, code});
  EXPECT_EQ(g[0].size(0), 0);
  EXPECT_EQ(g[1].abs().sum().item<double>(), 0);
}

TEST_P(LearnedLawOp, FloatFollowsDouble) {
  const LearnedNetworks w = networks();
  const Tensor F = generic_deformations(100, 0.2, 10), C = rates(F), z = latent();
  const LawOutput wide = learned_law(w, F, C, z);
  const LawOutput narrow =
      learned_law(w, F.to(torch::kFloat32), C.to(torch::kFloat32), latent(torch::kFloat32));
  EXPECT_EQ(narrow.tau.scalar_type(), torch::kFloat32);
  EXPECT_LE(relative(narrow.F_proj.to(torch::kFloat64), wide.F_proj), 3e-5);
  EXPECT_LE(relative(narrow.tau.to(torch::kFloat64), wide.tau), 1e-4);
}

TEST_P(LearnedLawOp, GivesOnlyTheGradientsAskedFor) {
  const LearnedNetworks w = networks();
  const Tensor F = generic_deformations(10, 0.2, 11), C = rates(F);
  const Tensor z = latent().requires_grad_();
  const LawOutput out = learned_law(w, F, C, z);
  const Tensor alone = torch::autograd::grad({out.tau.sum()}, {z}, {}, /*retain_graph=*/true)[0];
  EXPECT_GT(alone.abs().sum().item<double>(), 0);
  // The projected F does not depend on C: its gradient is zero, not garbage.
  const Tensor c = C.clone().requires_grad_();
  const Tensor of_C = torch::autograd::grad({learned_law(w, F, c, z).F_proj.sum()}, {c})[0];
  EXPECT_EQ(of_C.abs().max().item<double>(), 0);
}

TEST_P(LearnedLawOp, HasTheSameBitsOnEveryThreadCount) {
  const LearnedNetworks w = networks();
  const Tensor F = generic_deformations(1000, 0.2, 12).requires_grad_();
  const Tensor C = rates(F).requires_grad_(), z = latent().requires_grad_();
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const Gradients one = gradients(learned_law(w, F, C, z), F, C, z);
  omp_set_num_threads(2);
  const Gradients two = gradients(learned_law(w, F, C, z), F, C, z);
  omp_set_num_threads(threads);
  EXPECT_TRUE(torch::equal(one.F, two.F));
  EXPECT_TRUE(torch::equal(one.C, two.C));
  EXPECT_TRUE(torch::equal(one.z, two.z));
}

TEST_P(LearnedLawOp, ReferenceGradientsAreFiniteEverywhere) {
  const LearnedNetworks law = networks();
  Tensor F = torch::zeros({6, 3, 3}, torch::kFloat64);
  F[0] = torch::eye(3);
  F[2] = 1e-8 * torch::eye(3);
  F[3] = torch::diag(torch::tensor({1.0, 1.0, -1.0}));
  F[4] = torch::diag(torch::tensor({2.0, 0.5, -0.5}));
  F[5] = torch::diag(torch::tensor({1.2, 1.2, 1.0}));
  F.requires_grad_();
  const Tensor C = torch::zeros_like(F).requires_grad_(), z = latent().requires_grad_();
  LawOutput out;
  out.F_proj = reference::learned_project(law, F, z);
  out.tau = reference::learned_stress(law, out.F_proj, C, z);
  const Gradients g = gradients(out, F, C, z);
  for (const Tensor& t : {out.F_proj, out.tau, g.F, g.C, g.z})
    EXPECT_TRUE(torch::isfinite(t).all().item<bool>()) << t;
}

TEST_P(LearnedLawOp, ReferenceTakesALatentForEachParticle) {
  const LearnedNetworks law = networks();
  const Tensor F = generic_deformations(4, 0.2, 13), C = rates(F);
  const Tensor z = 0.3 * torch::randn({4, 5}, torch::kFloat64);
  const Tensor projected = reference::learned_project(law, F, z);
  const Tensor tau = reference::learned_stress(law, projected, C, z);
  for (int p = 0; p < 4; ++p) {
    const Tensor alone = reference::learned_project(law, F.slice(0, p, p + 1), z[p]);
    EXPECT_LE(relative(projected[p], alone[0]), 1e-13);
    EXPECT_LE(
        relative(tau[p], reference::learned_stress(law, alone, C.slice(0, p, p + 1), z[p])[0]),
        1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(All, LearnedLawOp, learned_law_cases(), learned_law_case);

TEST(LearnedLawOpErrors, NameTheArgument) {
  const LearnedNetworks w = to_networks(
      testing::random_weights(LawForm::isotropic, 4, 8, 1, Activation::silu, 1), torch::kFloat32);
  const Tensor F = torch::eye(3).repeat({5, 1, 1}), z = torch::zeros(4);
  EXPECT_EQ(testing::error_of([&] { learned_law(LearnedNetworks(), F, F, z); }),
            "learned law: networks: expected a trained model, found none");
  EXPECT_EQ(testing::error_of([&] { learned_law(w, F[0], F, z); }),
            "learned law: F_trial: expected [P, 3, 3] Float or Double on cpu, found [3, 3] Float "
            "on cpu");
  EXPECT_EQ(testing::error_of([&] { learned_law(w, F, F.slice(0, 1), z); }),
            "learned law: C: expected [5, 3, 3] Float on cpu, found [4, 3, 3] Float on cpu");
  EXPECT_EQ(testing::error_of([&] { learned_stress(w, F, F.to(torch::kFloat64), z); }),
            "learned law: C: expected [5, 3, 3] Float on cpu, found [5, 3, 3] Double on cpu");
  EXPECT_EQ(testing::error_of([&] { learned_project(w, F, torch::zeros(3)); }),
            "learned law: z: expected [4] Float on cpu, found [3] Float on cpu");
  EXPECT_EQ(testing::error_of([&] { learned_stress(w, F, Tensor(), z); }),
            "learned law: C: expected [5, 3, 3] Float on cpu, found an undefined tensor");
  EXPECT_EQ(testing::error_of([&] { learned_project(w, F, z, 0); }),
            "learned law: dt: expected a time step above 0 s, found 0.000000");
  const auto spoilt = [&](const std::function<void(LearnedNetworks&)>& spoil) {
    LearnedNetworks other = w;
    spoil(other);
    return testing::error_of([&] { learned_law(other, F, F, z); });
  };
  EXPECT_NO_THROW(learned_law(w, F, F, z));
  EXPECT_EQ(
      spoilt([](LearnedNetworks& n) { n.stress.widths.back() = 9; }),
      "learned law: networks.stress.widths: expected [10, ..., 14] (features and latent first, "
      "outputs last), found [10, 8, 9]");
  EXPECT_EQ(
      spoilt([](LearnedNetworks& n) { n.projection.numbers = n.projection.numbers.slice(0, 1); }),
      "learned law: networks.projection.numbers: expected [109] Float on cpu, found [108] "
      "Float on cpu");
  EXPECT_EQ(spoilt([](LearnedNetworks& n) { n.stress.numbers = n.stress.numbers.to(torch::kInt); }),
            "learned law: networks.stress.numbers: expected a Float or Double tensor, found [214] "
            "Int on cpu");
  EXPECT_EQ(
      spoilt([](LearnedNetworks& n) { n.stress.numbers = n.stress.numbers.to(torch::kFloat64); }),
      "learned law: networks.stress.numbers: expected [214] Float on cpu, found [214] Double "
      "on cpu");
}

}  // namespace
}  // namespace uniphy::ops
