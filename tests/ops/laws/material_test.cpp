// A material as tensors: from numbers and from the vector that fits move.

#include "ops/laws/material.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/kernels/laws/law_parameters.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/law_tensors.hpp"

namespace uniphy::testing {
namespace {

using kernels::LawDescription;
using kernels::LawId;
using torch::Tensor;

TEST(Material, FromNumbersAndFromAVectorAreTheSame) {
  for (const LawId id : analytic_laws()) {
    const LawDescription law = sample_law(id);
    const Tensor packed = ops::pack_material("op", id, ops::material_of(law));
    const Tensor values = torch::tensor(kernels::parameter_values(law), torch::kFloat64);
    EXPECT_TRUE(
        torch::equal(ops::pack_material("op", id, ops::material_of("op", id, values)), packed));
    for (const kernels::LawParameter& p : kernels::law_parameters(id))
      EXPECT_EQ(packed[p.place].item<double>(), law.*p.member) << p.name;
  }
}

TEST(Material, GradientsReachTheVector) {
  const Tensor values = torch::tensor({1e5, 2e5, 0.3}, torch::kFloat64).set_requires_grad(true);
  const Tensor packed =
      ops::pack_material("op", LawId::sand, ops::material_of("op", LawId::sand, values));
  (packed * torch::arange(1, kernels::kLawParameters + 1, torch::kFloat64)).sum().backward();
  // mu, lambda and theta stand at places 0, 1 and 3.
  EXPECT_TRUE(torch::equal(values.grad(), torch::tensor({1.0, 2.0, 4.0}, torch::kFloat64)));
}

TEST(Material, RefusesAVectorOfAnotherLength) {
  EXPECT_THAT(
      error_of([] { ops::material_of("op", LawId::sand, torch::zeros({2}, torch::kFloat64)); }),
      ::testing::HasSubstr("op: parameters: expected [3] Double on cpu, found [2] Double"));
}

}  // namespace
}  // namespace uniphy::testing
