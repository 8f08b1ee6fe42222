// ops::svd3 against torch::linalg_svd in the signed convention; the kernel itself is tested in
// tests/ops/kernels/svd3_test.cpp.

#include "ops/spectral/svd3.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/reference/svd3.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/on_threads.hpp"
#include "tests/support/tensors.hpp"

namespace uniphy::testing {
namespace {

using ::testing::HasSubstr;
using torch::Tensor;

Tensor samples() {
  torch::manual_seed(1);
  Tensor F = torch::randn({500, 3, 3}, torch::kFloat64);
  return torch::cat({F, torch::eye(3, torch::kFloat64) + 0.1 * F});
}

/// A loss that does not see the signs that U and V leave open.
Tensor loss(const ops::Svd3& s, const Tensor& A, const Tensor& B, const Tensor& C) {
  const Tensor weights = torch::tensor({1.0, -2.0, 0.5}, s.U.options());
  const Tensor left = torch::matmul(s.U * weights, s.U.transpose(1, 2));
  const Tensor right = torch::matmul(s.Vh.transpose(1, 2) * weights, s.Vh);
  return (A * left + B * right + C * torch::matmul(s.U * weights, s.Vh)).sum() +
         (s.sigma * s.sigma * weights).sum();
}

TEST(Svd3Op, AgreesWithTheReference) {
  const Tensor F = samples();
  const ops::Svd3 s = ops::svd3(F), r = ops::reference::svd3(F);
  EXPECT_LE(relative_difference(s.sigma, r.sigma), 1e-14);
  EXPECT_LE(relative_difference(torch::matmul(s.U * s.sigma.unsqueeze(1), s.Vh), F), 1e-14);
  EXPECT_LE(relative_difference(torch::matmul(r.U * r.sigma.unsqueeze(1), r.Vh), F), 1e-14);
  // Vectors up to sign: compare the projectors on each direction.
  for (int k = 0; k < 3; ++k) {
    const auto projector = [k](const Tensor& U) {
      const Tensor u = U.select(2, k);
      return u.unsqueeze(2) * u.unsqueeze(1);
    };
    EXPECT_LE((projector(s.U) - projector(r.U)).abs().max().item<double>(), 4e-13);
    EXPECT_LE((projector(s.Vh.transpose(1, 2)) - projector(r.Vh.transpose(1, 2)))
                  .abs()
                  .max()
                  .item<double>(),
              4e-13);
  }
  EXPECT_LE((torch::linalg_det(s.U) - 1).abs().max().item<double>(), 1e-14);
  EXPECT_LE((torch::linalg_det(s.Vh) - 1).abs().max().item<double>(), 1e-14);
}

TEST(Svd3Op, GradientAgreesWithTheReferenceWhereItExists) {
  Tensor F = samples();
  const Tensor sigma = ops::svd3(F).sigma;
  const Tensor gap = torch::minimum(sigma.select(1, 0) - sigma.select(1, 1),
                                    sigma.select(1, 1) - sigma.select(1, 2).abs());
  F = F.index({gap > 0.05}).clone().set_requires_grad(true);
  ASSERT_GT(F.size(0), 200);
  const Tensor A = torch::randn_like(F), B = torch::randn_like(F), C = torch::randn_like(F);
  const Tensor g = torch::autograd::grad({loss(ops::svd3(F), A, B, C)}, {F})[0];
  const Tensor r = torch::autograd::grad({loss(ops::reference::svd3(F), A, B, C)}, {F})[0];
  EXPECT_GT(r.abs().max().item<double>(), 1);
  for (int64_t p = 0; p < F.size(0); ++p) EXPECT_LE(relative_difference(g[p], r[p]), 4e-7) << p;
}

TEST(Svd3Op, GradientIsNeverNaN) {
  const Tensor F = torch::cat(
      {case_tensor(sample_law(kernels::LawId::elastic)), torch::zeros({1, 3, 3}, torch::kFloat64),
       torch::ones({1, 3, 3}, torch::kFloat64), -torch::eye(3, torch::kFloat64).unsqueeze(0)});
  for (const auto dtype : {torch::kFloat64, torch::kFloat32}) {
    const Tensor f = F.to(dtype, /*non_blocking=*/false, /*copy=*/true).set_requires_grad(true);
    const Tensor A = torch::randn_like(f), B = torch::randn_like(f), C = torch::randn_like(f);
    loss(ops::svd3(f), A, B, C).backward();
    EXPECT_TRUE(torch::isfinite(f.grad()).all().item<bool>());
  }
}

TEST(Svd3Op, UndefinedGradientsStayUndefined) {
  Tensor F = samples().set_requires_grad(true);
  // Only sigma is used: the gradients of U and Vh arrive undefined and count as zero.
  ops::svd3(F).sigma.sum().backward();
  const ops::Svd3 s = ops::svd3(F.detach());
  EXPECT_LE(relative_difference(F.grad(), torch::matmul(s.U, s.Vh)), 2e-15);
  EXPECT_FALSE(s.U.requires_grad());
  // Nothing arrives: nothing leaves.
  const ops::Svd3 unused = ops::svd3(F);
  EXPECT_FALSE(answer_of_backward(unused.sigma, {Tensor(), Tensor(), Tensor()})[0].defined());
}

TEST(Svd3Op, TakesAnyLayoutAndAnyCount) {
  const Tensor F = samples();
  const Tensor strided = F.transpose(1, 2).contiguous().transpose(1, 2);
  ASSERT_FALSE(strided.is_contiguous());
  EXPECT_TRUE(torch::equal(ops::svd3(strided).U, ops::svd3(F).U));
  const ops::Svd3 none = ops::svd3(F.slice(0, 0, 0));
  EXPECT_EQ(none.U.sizes(), torch::IntArrayRef({0, 3, 3}));
  EXPECT_EQ(none.sigma.sizes(), torch::IntArrayRef({0, 3}));
}

TEST(Svd3Op, SameBitsOnOneThreadAndTwo) {
  torch::manual_seed(2);
  const Tensor F = torch::randn({5000, 3, 3});
  const auto decompose = [&] { return ops::svd3(F); };
  const ops::Svd3 one = on_threads(1, decompose), two = on_threads(2, decompose);
  EXPECT_TRUE(torch::equal(one.U, two.U));
  EXPECT_TRUE(torch::equal(one.sigma, two.sigma));
  EXPECT_TRUE(torch::equal(one.Vh, two.Vh));
}

TEST(Svd3Op, RefusesOtherShapesAndTypes) {
  EXPECT_THAT(error_of([] {
                ops::svd3(torch::zeros({4, 3, 2}));
              }),
              ::testing::AllOf(HasSubstr("svd3: F: expected [P, 3, 3]"), HasSubstr("[4, 3, 2]")));
  EXPECT_THAT(error_of([] { ops::svd3(torch::zeros({3, 3})); }), HasSubstr("[3, 3]"));
  EXPECT_THAT(error_of([] {
                ops::svd3(torch::zeros({4, 3, 3}, torch::kInt32));
              }),
              HasSubstr("found [4, 3, 3] Int"));
  EXPECT_THAT(error_of([] { ops::svd3(Tensor()); }), HasSubstr("undefined"));
}

}  // namespace
}  // namespace uniphy::testing
