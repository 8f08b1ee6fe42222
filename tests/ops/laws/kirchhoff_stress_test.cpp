// ops::kirchhoff_stress against plain tensor operations and central differences.

#include "ops/laws/kirchhoff_stress.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/reference/kirchhoff_stress.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/law_tensors.hpp"

namespace uniphy::testing {
namespace {

using kernels::LawId;
using ::testing::AllOf;
using ::testing::HasSubstr;
using torch::Tensor;

class KirchhoffStressOp : public AnalyticLaws {
 protected:
  Tensor stress(const Tensor& F, const Tensor& C) const {
    return ops::kirchhoff_stress(id(), F, C, ops::material_of(description()));
  }
};
INSTANTIATE_TEST_SUITE_P(All, KirchhoffStressOp, ::testing::ValuesIn(analytic_laws()),
                         [](const auto& info) {
                           return std::string(kernels::law_name(info.param));
                         });

TEST_P(KirchhoffStressOp, AgreesWithTheReference) {
  // The pressure of a fluid reaches 1e36 Pa at the clamp of J: one state at a time.
  const Tensor all = torch::cat({case_tensor(description()), separated_states()});
  torch::manual_seed(6);
  const Tensor C = 10 * torch::randn_like(all);
  const Tensor tau = stress(all, C);
  const Tensor reference =
      ops::reference::kirchhoff_stress(id(), all, C, ops::material_of(description()));
  for (int64_t p = 0; p < all.size(0); ++p) {
    const double scale = std::max(reference[p].abs().max().item<double>(), 1e4);
    // J, and with it J⁻⁶, is known to rounding of the entries of F only.
    const double condition = 1 + 1e-2 / std::abs(torch::linalg_det(all[p]).item<double>());
    EXPECT_LE((tau[p] - reference[p]).abs().max().item<double>(), 1e-12 * condition * scale) << p;
  }
}

TEST_P(KirchhoffStressOp, FloatAgreesWithDouble) {
  const Tensor F = separated_states().to(torch::kFloat32), C = torch::randn_like(F);
  const Tensor wide = stress(F.to(torch::kFloat64), C.to(torch::kFloat64));
  EXPECT_LE(relative_difference(stress(F, C).to(torch::kFloat64), wide), 1e-5);
}

TEST_P(KirchhoffStressOp, GradientAgreesWithTheReferenceWhereItExists) {
  const Tensor F = separated_states().set_requires_grad(true);
  torch::manual_seed(7);
  const Tensor C = torch::randn_like(F).set_requires_grad(true);
  const MaterialLeaves leaves(description());
  const Tensor W = torch::randn_like(F);
  const Tensor loss = (ops::kirchhoff_stress(id(), F, C, leaves.material()) * W).sum();
  const Tensor reference =
      (ops::reference::kirchhoff_stress(id(), F, C, leaves.material()) * W).sum();
  const Tensor g = torch::autograd::grad({loss}, {F}, {}, true)[0];
  const Tensor r = torch::autograd::grad({reference}, {F}, {}, true)[0];
  EXPECT_GT(g.abs().max().item<double>(), 1);
  for (int64_t p = 0; p < F.size(0); ++p) EXPECT_LE(relative_difference(g[p], r[p]), 1e-13) << p;
  EXPECT_GT(leaves.gradient(loss).abs().max().item<double>(), 1);
  EXPECT_LE(relative_difference(leaves.gradient(loss), leaves.gradient(reference)), 5e-14);
  const Tensor of_C = torch::autograd::grad({loss}, {C}, {}, true)[0];
  if (is_viscous_fluid(id())) {
    const Tensor expected = torch::autograd::grad({reference}, {C}, {}, true)[0];
    EXPECT_GT(of_C.abs().max().item<double>(), 1);
    EXPECT_LE(relative_difference(of_C, expected), 2e-15);
  } else {
    EXPECT_EQ(of_C.abs().max().item<double>(), 0);
  }
}

TEST_P(KirchhoffStressOp, GradientMatchesCentralDifferencesAtEqualSingularValues) {
  torch::manual_seed(8);
  const Tensor C = torch::randn({1, 3, 3}, torch::kFloat64);
  expect_gradient_by_differences(description(), 1e3, [&](const Tensor& F) { return stress(F, C); });
}

TEST_P(KirchhoffStressOp, SameBitsOnOneThreadAndTwo) {
  torch::manual_seed(9);
  const Tensor C = torch::randn({5000, 3, 3});
  expect_same_bits_on_threads(description(), [&](const Tensor& F, const ops::Material& material) {
    return ops::kirchhoff_stress(id(), F, C, material);
  });
}

TEST_P(KirchhoffStressOp, UndefinedGradientsStayUndefined) {
  const Tensor F = separated_states(), C = torch::randn_like(F).set_requires_grad(true);
  const MaterialLeaves leaves(description());
  const Tensor tau = ops::kirchhoff_stress(id(), F, C, leaves.material());
  const auto answer = answer_of_backward(tau, {torch::ones_like(tau)});
  EXPECT_FALSE(answer[0].defined());  // by F, which wants none
  EXPECT_TRUE(answer[1].defined());
  EXPECT_TRUE(answer[2].defined());
  for (const Tensor& none : answer_of_backward(tau, {Tensor()})) EXPECT_FALSE(none.defined());
  EXPECT_TRUE(torch::equal(stress(F, {}), stress(F, torch::zeros_like(F))));
}

TEST(KirchhoffStressOp, RefusesBadArguments) {
  const Tensor F = separated_states();
  const auto message = [&](LawId law, const Tensor& f, const Tensor& C, const ops::Material& m) {
    return error_of([&] { ops::kirchhoff_stress(law, f, C, m); });
  };
  const ops::Material good = ops::material_of(sample_law(LawId::elastic));
  EXPECT_THAT(message(LawId::elastic, F.to(torch::kInt64), {}, good),
              HasSubstr("found [32, 3, 3] Long"));
  EXPECT_THAT(message(LawId::elastic, F, torch::zeros({4, 3, 3}, torch::kFloat64), good),
              AllOf(HasSubstr("C: expected [32, 3, 3] Double"), HasSubstr("found [4, 3, 3]")));
  EXPECT_THAT(message(LawId::elastic, F, F.to(torch::kFloat32), good), HasSubstr("Float on cpu"));
  EXPECT_THAT(message(LawId::learned, F, {}, good), HasSubstr("found learned"));
  ops::Material bad = good;
  bad.lambda = std::nan("");
  EXPECT_THAT(message(LawId::elastic, F, {}, bad), AllOf(HasSubstr("lambda"), HasSubstr("nan")));
}

}  // namespace
}  // namespace uniphy::testing
