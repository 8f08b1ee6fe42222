// ops::return_mapping against plain tensor operations and central differences.

#include "ops/laws/return_mapping.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include "ops/reference/return_mapping.hpp"
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
    const Tensor projected = ops::return_mapping(id(), F, numbers(description()), kDt);
    const Tensor reference = ops::reference::return_mapping(id(), F, numbers(description()), kDt);
    EXPECT_LE(relative_difference(projected, reference), 1e-13);
    const Tensor single =
        ops::return_mapping(id(), F.to(torch::kFloat32), numbers(description()), kDt);
    EXPECT_EQ(single.scalar_type(), torch::kFloat32);
    EXPECT_LE(relative_difference(single.to(torch::kFloat64), reference), 1e-5);
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
  for (int64_t p = 0; p < F.size(0); ++p) EXPECT_LE(relative_difference(g[p], r[p]), 1e-9) << p;
  const Tensor of_parameters = leaves.gradient(loss);
  if (is_plastic(id())) {
    EXPECT_GT(of_parameters.abs().max().item<double>(), 1e-3);
    EXPECT_LE(relative_difference(of_parameters, leaves.gradient(reference)), 1e-9);
  } else {
    EXPECT_EQ(of_parameters.abs().max().item<double>(), 0);
  }
}

// The whole way through autograd at states where torch's own SVD gives NaN.
TEST_P(ReturnMappingOp, GradientMatchesCentralDifferencesAtEqualSingularValues) {
  torch::manual_seed(4);
  for (const DeformationCase& c : cases_of(description())) {
    Tensor F = to_tensor({c.F}).set_requires_grad(true);
    const Tensor W = torch::randn_like(F);
    const auto loss = [&](const Tensor& f) {
      return (ops::return_mapping(id(), f, numbers(description()), kDt) * W).sum();
    };
    loss(F).backward();
    const Tensor differences = numerical_gradient(loss, F, c.step);
    EXPECT_LE((F.grad() - differences).norm().item<double>(),
              1e-6 * std::max(differences.norm().item<double>(), 1e-3))
        << c.group;
  }
}

TEST_P(ReturnMappingOp, SameBitsOnOneThreadAndTwo) {
  torch::manual_seed(5);
  const Tensor F = (torch::eye(3) + 0.2 * torch::randn({5000, 3, 3})).set_requires_grad(true);
  const Tensor W = torch::randn_like(F);
  const int before = omp_get_max_threads();
  Tensor grads[2], parameters[2];
  for (int threads : {1, 2}) {
    omp_set_num_threads(threads);
    const MaterialLeaves leaves(description());
    const Tensor loss = (ops::return_mapping(id(), F, leaves.material(), kDt) * W).sum();
    grads[threads - 1] = torch::autograd::grad({loss}, {F}, {}, true)[0];
    parameters[threads - 1] = leaves.gradient(loss);
  }
  omp_set_num_threads(before);
  EXPECT_TRUE(torch::equal(grads[0], grads[1]));
  EXPECT_TRUE(torch::equal(parameters[0], parameters[1]));
}

TEST_P(ReturnMappingOp, UndefinedGradientsStayUndefined) {
  const MaterialLeaves leaves(description());
  const Tensor F = separated_states();
  const Tensor projected = ops::return_mapping(id(), F, leaves.material(), kDt);
  projected.sum().backward();
  EXPECT_FALSE(F.grad().defined());
  EXPECT_TRUE(leaves.leaves[0].grad().defined());
  const Tensor wanted = separated_states().set_requires_grad(true);
  ops::return_mapping(id(), wanted, numbers(description()), kDt).sum().backward();
  EXPECT_TRUE(wanted.grad().defined());
  EXPECT_FALSE(ops::return_mapping(id(), F, numbers(description()), kDt).requires_grad());
}

TEST_P(ReturnMappingOp, TakesAnyLayoutAndAnyCount) {
  const Tensor F = separated_states();
  const Tensor strided = F.transpose(1, 2).contiguous().transpose(1, 2);
  const auto map = [&](const Tensor& f) {
    return ops::return_mapping(id(), f, numbers(description()), kDt);
  };
  EXPECT_TRUE(torch::equal(map(strided), map(F)));
  EXPECT_EQ(map(F.slice(0, 0, 0)).sizes(), torch::IntArrayRef({0, 3, 3}));
  EXPECT_TRUE(torch::equal(map(F.slice(0, 3, 4)), map(F).slice(0, 3, 4)));
}

TEST(ReturnMappingOp, RefusesBadArguments) {
  const Tensor F = separated_states();
  const auto message = [&](LawId law, const Tensor& f, const ops::Material& m, double dt) {
    return error_message([&] { ops::return_mapping(law, f, m, dt); });
  };
  const ops::Material good = numbers(sample_law(LawId::sand));
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
