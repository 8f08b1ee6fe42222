// The references to fail: right where singular values are apart, wrong where they meet.

#include "uniphy/stability/svd_derivatives.hpp"

#include <gtest/gtest.h>

#include "ops/base/torch.hpp"
#include "ops/laws/kirchhoff_stress.hpp"
#include "ops/laws/return_mapping.hpp"
#include "tests/uniphy/stability/stability_cases.hpp"
#include "uniphy/stability/gradient_check.hpp"
#include "uniphy/stability/spectral_states.hpp"

namespace uniphy::stability {
namespace {

using torch::Tensor;

Tensor states(const std::string& stressor) {
  StabilityOptions o;
  o.spectral_states = 200;
  o.spectral_condition = 10;
  for (const StateSet& set : spectral_states(o)) {
    if (set.stressor == stressor)
      return torch::tensor(set.F, torch::kFloat64).view({-1, 3, 3}).clone();
  }
  return {};
}

Tensor gradient(const StateFunction& f, const Tensor& F, const Tensor& w) {
  const Tensor variable = F.clone().requires_grad_();
  return torch::autograd::grad({(f(variable) * w).sum()}, {variable})[0];
}

/// ‖a − b‖/‖b‖ of all states together.
double error(const Tensor& a, const Tensor& b) {
  return ((a - b).norm() / b.norm()).item<double>();
}

StateFunction rotation_with(SvdDerivative derivative) {
  return [derivative](const Tensor& F) {
    const ops::Svd3 s = svd_with(derivative, F);
    return torch::matmul(s.U, s.Vh);
  };
}

StateFunction our_rotation() {
  return [](const Tensor& F) {
    const kernels::LawDescription law = testing::sand_law();
    return ops::return_mapping(law.id, F, ops::material_of(law), 2e-4);
  };
}

TEST(SvdDerivatives, FactorsAreRotationsAndMakeUpF) {
  for (const char* stressor : {"random_states", "inverted", "rank_loss", "at_rest"}) {
    const Tensor F = states(stressor);
    for (const SvdDerivative derivative : {SvdDerivative::raw, SvdDerivative::clamped}) {
      const ops::Svd3 s = svd_with(derivative, F);
      EXPECT_LT((torch::matmul(s.U * s.sigma.unsqueeze(-2), s.Vh) - F).abs().max().item<double>(),
                1e-14);
      EXPECT_LT((torch::linalg_det(s.U) - 1).abs().max().item<double>(), 1e-12);
      EXPECT_LT((torch::linalg_det(s.Vh) - 1).abs().max().item<double>(), 1e-12);
      EXPECT_TRUE((s.sigma.select(1, 0) >= s.sigma.select(1, 1)).all().item<bool>());
    }
  }
}

TEST(SvdDerivatives, BothAreRightWhereTheValuesAreApart) {
  Tensor F = torch::diag_embed(torch::tensor({{1.5, 1.1, 0.7}, {1.4, 0.9, -0.3}}, torch::kFloat64));
  const Tensor w = torch::linspace(-1, 1, 18, torch::kFloat64).view({2, 3, 3});
  F = F + 0.05 * w;
  for (const auto& part : {0, 1, 2}) {
    const auto with = [part](SvdDerivative d) -> StateFunction {
      return [part, d](const Tensor& A) {
        const ops::Svd3 s = svd_with(d, A);
        return part == 0 ? s.U : part == 1 ? s.Vh : torch::diag_embed(s.sigma);
      };
    };
    EXPECT_LT(error(gradient(with(SvdDerivative::clamped), F, w),
                    gradient(with(SvdDerivative::raw), F, w)),
              1e-12)
        << part;
  }
}

TEST(SvdDerivatives, TheClampLosesTheGradientThroughARotation) {
  const double tension = 1 + 1e-4;
  const Tensor Q = states("rotation") * tension, near = states("near_rotation") * tension;
  const Tensor w = torch::linspace(-1, 1, Q.numel(), torch::kFloat64).view_as(Q);
  const Tensor exact = polar_rotation_gradient(Q, w), exact_near = polar_rotation_gradient(near, w);

  const StateFunction clamped = rotation_with(SvdDerivative::clamped);
  EXPECT_GT(error(gradient(clamped, Q, w), exact), 0.8);
  EXPECT_GT(error(gradient(clamped, near, w), exact_near), 0.05);
  EXPECT_LT(error(gradient(clamped, near, w), exact_near), 0.4);

  EXPECT_LT(error(gradient(our_rotation(), Q, w), exact), 1e-14);
  EXPECT_LT(error(gradient(our_rotation(), near, w), exact_near), 1e-14);
}

TEST(SvdDerivatives, TheRawOneIsNotFiniteAtRest) {
  const Tensor I = torch::eye(3, torch::kFloat64).unsqueeze(0);
  const Tensor w = torch::linspace(-1, 1, 9, torch::kFloat64).view({1, 3, 3});
  const Tensor raw = gradient(rotation_with(SvdDerivative::raw), I, w);
  EXPECT_FALSE(torch::isfinite(raw).all().item<bool>());
  // The clamp answers 0 where the derivative is skew(w).
  const Tensor clamped = gradient(rotation_with(SvdDerivative::clamped), I, w);
  EXPECT_EQ(clamped.norm().item<double>(), 0);
  EXPECT_LT(error(polar_rotation_gradient(I, w), 0.5 * (w - w.mT())), 1e-15);
  EXPECT_LT(error(gradient(our_rotation(), I * 1.0001, w), 0.5 * (w - w.mT()) / 1.0001), 1e-14);
}

TEST(SvdDerivatives, TheirGradientsThroughTheFactorsAreHuge) {
  const Tensor Q = states("rotation");
  const Tensor w = torch::linspace(-1, 1, 9, torch::kFloat64).view({1, 3, 3});
  const auto U = [](const Tensor& F) { return svd_with(SvdDerivative::raw, F).U; };
  EXPECT_GT(gradient(U, Q, w).abs().max().item<double>(), 8e6);
}

TEST(SvdDerivatives, TheLawsAreThoseOfTheKernels) {
  const double dt = 2e-4;
  for (const kernels::LawDescription& law :
       {testing::plasticine_law(), testing::sand_law(), testing::non_newtonian_law()}) {
    for (const char* stressor : {"random_states", "near_equal_values", "inverted"}) {
      const Tensor F = states(stressor);
      const PlasticTensors out = plastic_tensors(law, svd_with(SvdDerivative::raw, F), F, dt);
      const ops::Material material = ops::material_of(law);
      const Tensor F_proj = ops::return_mapping(law.id, F, material, dt);
      EXPECT_LT(error(out.F_proj, F_proj), 1e-12) << kernels::law_name(law.id) << stressor;
      const Tensor tau = ops::kirchhoff_stress(law.id, F_proj, {}, material);
      EXPECT_LT(error(out.tau, tau), 1e-11) << kernels::law_name(law.id) << stressor;
    }
  }
}

TEST(SvdDerivatives, TheExactGradientOfTheRotationIsThatOfDifferences) {
  const Tensor F = states("near_equal_values");
  const Tensor w = torch::linspace(-1, 1, F.numel(), torch::kFloat64).view_as(F);
  const Tensor exact = polar_rotation_gradient(F, w);
  const double h = 1e-4;
  for (int k = 0; k < 9; ++k) {
    Tensor step = torch::zeros({9}, torch::kFloat64);
    step[k] = h;
    const auto at = [&](double s) {
      const ops::Svd3 factors = ops::svd3(F + s * step.view({3, 3}));
      return (torch::matmul(factors.U, factors.Vh) * w).flatten(1).sum(1);
    };
    const Tensor slope = (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * h);
    EXPECT_LT(error(exact.flatten(1).select(1, k), slope), 1e-9) << k;
  }
}

}  // namespace
}  // namespace uniphy::stability
