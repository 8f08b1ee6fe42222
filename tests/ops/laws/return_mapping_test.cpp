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
INSTANTIATE_TEST_SUITE_P(All, ReturnMappingOp, ::testing::ValuesIn(laws_without_memory()),
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

// ---- with memory --------------------------------------------------------------------------------

constexpr LawId kCorrected = LawId::volume_corrected_sand;

/// Between nothing and more than the strain of any state.
Tensor memories(const Tensor& F) {
  torch::manual_seed(21);
  return torch::rand({F.size(0)}, torch::kFloat64).pow(3);
}

TEST(ReturnMappingWithMemory, AgreesWithTheReferenceInValueAndGradient) {
  const Tensor F = separated_states().set_requires_grad(true);
  const Tensor memory = memories(F).set_requires_grad(true);
  const MaterialLeaves leaves(sample_law(kCorrected));
  const auto found = ops::return_mapping_with_memory(kCorrected, F, memory, leaves.material(), kDt);
  const auto expected =
      ops::reference::return_mapping_with_memory(kCorrected, F, memory, leaves.material());
  EXPECT_LE(relative_difference(found.F_proj, expected.F_proj), 4e-14);
  EXPECT_LE((found.memory - expected.memory).abs().max().item<double>(), 4e-15);
  EXPECT_GT((found.memory > 0).sum().item<int64_t>(), 5);
  EXPECT_GT((found.memory == 0).sum().item<int64_t>(), 5);
  const auto single =
      ops::return_mapping_with_memory(kCorrected, F.to(torch::kFloat32), memory.to(torch::kFloat32),
                                      ops::material_of(sample_law(kCorrected)), kDt);
  EXPECT_EQ(single.memory.scalar_type(), torch::kFloat32);
  EXPECT_LE(relative_difference(single.F_proj.to(torch::kFloat64), expected.F_proj), 5e-6);
  torch::manual_seed(22);
  const Tensor W = torch::randn_like(F), w = torch::randn_like(memory);
  const auto loss = [&](const ops::MemoryMapping& m) {
    return (m.F_proj * W).sum() + (m.memory * w).sum();
  };
  for (const Tensor& leaf : {F, memory}) {
    const Tensor g = torch::autograd::grad({loss(found)}, {leaf}, {}, true)[0];
    const Tensor r = torch::autograd::grad({loss(expected)}, {leaf}, {}, true)[0];
    EXPECT_GT(g.abs().max().item<double>(), 0.1);
    for (int64_t p = 0; p < F.size(0); ++p)
      EXPECT_LE((g[p] - r[p]).norm().item<double>(), 1e-12 * (1 + r[p].norm().item<double>())) << p;
  }
  EXPECT_LE(relative_difference(leaves.gradient(loss(found)), leaves.gradient(loss(expected))),
            3e-13);
}

TEST(ReturnMappingWithMemory, SameBitsOnOneThreadAndTwo) {
  torch::manual_seed(5);
  const Tensor memory = torch::rand({5000}).set_requires_grad(true);
  expect_same_bits_on_threads(
      sample_law(kCorrected), [&](const Tensor& F, const ops::Material& material) {
        const auto m = ops::return_mapping_with_memory(kCorrected, F, memory, material, kDt);
        return m.F_proj * m.memory.view({-1, 1, 1});
      });
}

TEST(ReturnMappingWithMemory, EitherAnswerMayBeTheOneThatIsAskedFor) {
  const Tensor F = separated_states().set_requires_grad(true);
  const Tensor memory = memories(F).set_requires_grad(true);
  const ops::Material material = ops::material_of(sample_law(kCorrected));
  const auto m = ops::return_mapping_with_memory(kCorrected, F, memory, material, kDt);
  const auto by_memory = torch::autograd::grad({m.memory.sum()}, {F, memory}, {}, true);
  EXPECT_EQ(by_memory[1].min().item<double>(), 0);  // given back
  EXPECT_EQ(by_memory[1].max().item<double>(), 1);  // kept
  const auto by_F = torch::autograd::grad({m.F_proj.sum()}, {F, memory}, {}, true);
  const auto both = torch::autograd::grad({m.F_proj.sum() + m.memory.sum()}, {F, memory});
  for (int i : {0, 1})
    EXPECT_LE((by_memory[i] + by_F[i] - both[i]).abs().max().item<double>(), 1e-12);
}

TEST(ReturnMappingWithMemory, RefusesBadArguments) {
  const Tensor F = separated_states(), memory = memories(F);
  const ops::Material good = ops::material_of(sample_law(LawId::sand));
  EXPECT_THAT(error_of([&] { ops::return_mapping_with_memory(LawId::sand, F, memory, good, kDt); }),
              HasSubstr("return_mapping_with_memory: law: expected one with memory, found sand"));
  EXPECT_THAT(error_of([&] { ops::return_mapping(kCorrected, F, good, kDt); }),
              HasSubstr("return_mapping: law: expected one without memory"));
  EXPECT_THAT(error_of([&] {
                ops::return_mapping_with_memory(kCorrected, F, memory.slice(0, 1), good, kDt);
              }),
              HasSubstr("memory: expected [32] Double on cpu, found [31]"));
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
