// ops::return_mapping against plain tensor operations and central differences.

#include "ops/laws/return_mapping.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/reference/return_mapping.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/law_tensors.hpp"

namespace uniphy::testing {
namespace {

using kernels::LawId;
using ::testing::AllOf;
using ::testing::HasSubstr;
using torch::Tensor;

constexpr double kDt = 1e-4;

class ReturnMappingOp : public AnalyticLaws {};
INSTANTIATE_TEST_SUITE_P(All, ReturnMappingOp, ::testing::ValuesIn(analytic_laws()),
                         [](const auto& info) {
                           return std::string(kernels::law_name(info.param));
                         });

TEST_P(ReturnMappingOp, AgreesWithTheReference) {
  for (const Tensor& F : {case_tensor(description()), separated_states()}) {
    const Tensor projected = ops::return_mapping(id(), F, ops::material_of(description()), kDt);
    const Tensor reference =
        ops::reference::return_mapping(id(), F, ops::material_of(description()), kDt);
    EXPECT_LE(relative_difference(projected, reference), 4e-14);
    const Tensor single =
        ops::return_mapping(id(), F.to(torch::kFloat32), ops::material_of(description()), kDt);
    EXPECT_EQ(single.scalar_type(), torch::kFloat32);
    EXPECT_LE(relative_difference(single.to(torch::kFloat64), reference), 5e-6);
  }
}

TEST_P(ReturnMappingOp, GradientAgreesWithTheReferenceWhereItExists) {
  const Tensor F = separated_states().set_requires_grad(true);
  const MaterialLeaves leaves(description());
  torch::manual_seed(3);
  const Tensor W = torch::randn_like(F);
  const Tensor loss = (ops::return_mapping(id(), F, leaves.material(), kDt) * W).sum();
  const Tensor reference =
      (ops::reference::return_mapping(id(), F, leaves.material(), kDt) * W).sum();
  const Tensor g = torch::autograd::grad({loss}, {F}, {}, true)[0];
  const Tensor r = torch::autograd::grad({reference}, {F}, {}, true)[0];
  EXPECT_GT(g.abs().max().item<double>(), 0.1);
  for (int64_t p = 0; p < F.size(0); ++p) EXPECT_LE(relative_difference(g[p], r[p]), 3e-13) << p;
  const Tensor of_parameters = leaves.gradient(loss);
  if (is_plastic(id())) {
    EXPECT_GT(of_parameters.abs().max().item<double>(), 1e-3);
    EXPECT_LE(relative_difference(of_parameters, leaves.gradient(reference)), 3e-13);
  } else {
    EXPECT_EQ(of_parameters.abs().max().item<double>(), 0);
  }
}

TEST_P(ReturnMappingOp, GradientMatchesCentralDifferencesAtEqualSingularValues) {
  torch::manual_seed(4);
  expect_gradient_by_differences(description(), 1e-3, [&](const Tensor& F) {
    return ops::return_mapping(id(), F, ops::material_of(description()), kDt);
  });
}

TEST_P(ReturnMappingOp, SameBitsOnOneThreadAndTwo) {
  torch::manual_seed(5);
  expect_same_bits_on_threads(description(), [&](const Tensor& F, const ops::Material& material) {
    return ops::return_mapping(id(), F, material, kDt);
  });
}

TEST_P(ReturnMappingOp, UndefinedGradientsStayUndefined) {
  const MaterialLeaves leaves(description());
  const Tensor F = separated_states();
  const Tensor projected = ops::return_mapping(id(), F, leaves.material(), kDt);
  const auto answer = answer_of_backward(projected, {torch::ones_like(projected)});
  EXPECT_FALSE(answer[0].defined());  // by F, which wants none
  EXPECT_TRUE(answer[1].defined());
  for (const Tensor& none : answer_of_backward(projected, {Tensor()})) EXPECT_FALSE(none.defined());
  const Tensor wanted = separated_states().set_requires_grad(true);
  ops::return_mapping(id(), wanted, ops::material_of(description()), kDt).sum().backward();
  EXPECT_TRUE(wanted.grad().defined());
  EXPECT_FALSE(ops::return_mapping(id(), F, ops::material_of(description()), kDt).requires_grad());
}

TEST_P(ReturnMappingOp, TakesAnyLayoutAndAnyCount) {
  const Tensor F = separated_states();
  const Tensor strided = F.transpose(1, 2).contiguous().transpose(1, 2);
  const auto map = [&](const Tensor& f) {
    return ops::return_mapping(id(), f, ops::material_of(description()), kDt);
  };
  EXPECT_TRUE(torch::equal(map(strided), map(F)));
  EXPECT_EQ(map(F.slice(0, 0, 0)).sizes(), torch::IntArrayRef({0, 3, 3}));
  EXPECT_TRUE(torch::equal(map(F.slice(0, 3, 4)), map(F).slice(0, 3, 4)));
}

TEST(ReturnMappingOp, RefusesBadArguments) {
  const Tensor F = separated_states();
  const auto message = [&](LawId law, const Tensor& f, const ops::Material& m, double dt) {
    return error_of([&] { ops::return_mapping(law, f, m, dt); });
  };
  const ops::Material good = ops::material_of(sample_law(LawId::sand));
  EXPECT_THAT(
      message(LawId::sand, F.view({-1, 9}), good, kDt),
      AllOf(HasSubstr("return_mapping: F: expected [P, 3, 3]"), HasSubstr("found [32, 9]")));
  EXPECT_THAT(message(LawId::sand, F, good, -1), HasSubstr("dt: expected"));
  EXPECT_THAT(message(LawId::learned, F, good, kDt), HasSubstr("found learned"));
  ops::Material bad = good;
  bad.theta = torch::zeros({2});
  EXPECT_THAT(message(LawId::sand, F, bad, kDt), AllOf(HasSubstr("theta"), HasSubstr("found [2]")));
  bad = good;
  bad.mu = -1.0;
  EXPECT_THAT(message(LawId::sand, F, bad, kDt), AllOf(HasSubstr("mu"), HasSubstr("found -1")));
}

}  // namespace
}  // namespace uniphy::testing
