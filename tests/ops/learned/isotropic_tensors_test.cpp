// The references' signed SVD and Hencky strain in plain tensors.

#include "ops/reference/isotropic_tensors.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "ops/base/torch.hpp"
#include "ops/reference/signed_svd.hpp"
#include "tests/support/deformation_tensors.hpp"

namespace uniphy::ops {
namespace {

using testing::generic_deformations;
using testing::relative;
using testing::tensor_of;
using torch::Tensor;

TEST(SignedSvdReference, IsTheSignedConvention) {
  const Tensor F = torch::cat({generic_deformations(50, 0.5, 1), -generic_deformations(50, 0.5, 2),
                               torch::zeros({1, 3, 3})});
  const reference::SignedSvd s = reference::signed_svd(F);
  EXPECT_LE(relative(s.U.matmul(torch::diag_embed(s.sigma)).matmul(s.V.mT()), F), 1e-14);
  EXPECT_LE((torch::linalg_det(s.U) - 1).abs().max().item<double>(), 1e-13);
  EXPECT_LE((torch::linalg_det(s.V) - 1).abs().max().item<double>(), 1e-13);
  const Tensor magnitude = s.sigma.abs();
  EXPECT_TRUE((magnitude.slice(1, 0, 2) >= magnitude.slice(1, 1, 3)).all().item<bool>());
  EXPECT_TRUE((s.sigma.slice(1, 0, 2) >= 0).all().item<bool>());
}

TEST(HenckyTensorReference, DerivativeIsExactAtEveryGap) {
  for (const auto& c : testing::deformation_cases()) {
    SCOPED_TRACE(c.group);
    const Tensor F = tensor_of({c.F}).requires_grad_();
    torch::manual_seed(2);
    const Tensor G = torch::randn({1, 3, 3}, torch::kFloat64);
    const Tensor dF = torch::randn({1, 3, 3}, torch::kFloat64);
    const Tensor value =
        (torch::autograd::grad({(G * reference::hencky_tensor(F)).sum()}, {F})[0] * dF).sum();
    const torch::NoGradGuard guard;
    const auto f = [&](double s) {
      return (G * reference::hencky_tensor(F + s * dF)).sum().item<double>();
    };
    const double h = c.step;
    const double expected = (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
    EXPECT_NEAR(value.item<double>(), expected, 1e-6 * (1 + std::abs(expected)));
  }
}

}  // namespace
}  // namespace uniphy::ops
