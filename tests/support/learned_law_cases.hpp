#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/learned/learned_law.hpp"
#include "tests/support/law_cases.hpp"
#include "tests/support/random_weights.hpp"
#include "tests/support/tensors.hpp"

namespace uniphy::testing {

/// Relative errors of the learned law's op against central differences, group by group of
/// deformation_cases.
struct LearnedLawErrors {
  std::map<std::string, double> F, C, z;
  std::map<std::string, double> weights;  ///< along a random direction in all numbers
};

/// Fourth-order central differences of `loss` along every coordinate of `x`. Random networks have
/// their yield surfaces anywhere: a coordinate whose two step sizes disagree has a kink within its
/// stencil, and is left out on both sides.
template <class Loss>
double smooth_gradient_error(const torch::Tensor& gradient, const torch::Tensor& x, double step,
                             const Loss& loss) {
  const torch::NoGradGuard guard;
  const torch::Tensor fine = numerical_gradient(loss, x, step);
  const torch::Tensor coarse = numerical_gradient(loss, x, 3 * step);
  const torch::Tensor smooth = (fine - coarse).abs() <= 1e-5 * (fine.abs().max() + 1e-12);
  if (smooth.sum().item<std::int64_t>() * 10 < smooth.numel() * 9) return INFINITY;
  const torch::Tensor error = (gradient - fine).masked_select(smooth);
  return (error.norm() / fine.masked_select(smooth).norm()).item<double>();
}

/// A law with random weights. The published form sees the factors of F, which have a derivative
/// only where the singular values are apart: the other cases are left out.
inline LearnedLawErrors learned_law_errors(kernels::LawForm form) {
  const auto weights = random_weights(form, 5, 20, 2, kernels::Activation::gelu, 7);
  const auto networks = ops::to_networks(weights, torch::kFloat64);
  const auto elastic = ops::to_networks(*kernels::without_projection(weights), torch::kFloat64);
  LearnedLawErrors errors;
  std::mt19937_64 random(29);
  for (const DeformationCase& c : deformation_cases()) {
    const double upper = c.sigma[0] - c.sigma[4], lower = c.sigma[4] - std::abs(c.sigma[8]);
    if (form == kernels::LawForm::published && std::min(upper, lower) < 0.01) continue;
    // A random law yields at rest, as sand does: F = I is its tip, where no derivative exists. What
    // does not yield has one there.
    const ops::LearnedNetworks& of_case = c.F == identity() ? elastic : networks;
    ops::LearnedNetworks law = of_case;
    law.projection.numbers = of_case.projection.numbers.clone().requires_grad_();
    law.stress.numbers = of_case.stress.numbers.clone().requires_grad_();
    const torch::Tensor F = to_tensor({c.F}).requires_grad_();
    const torch::Tensor C = to_tensor({random_matrix(random, 8)}).requires_grad_();
    const torch::Tensor z =
        torch::tensor({0.3, -0.2, 0.5, -0.7, 0.1}, torch::kFloat64).requires_grad_();
    const torch::Tensor G = to_tensor({random_matrix(random)});
    const torch::Tensor S = to_tensor({random_matrix(random, 1e-4)});  // 1/Pa
    const auto loss = [&](const torch::Tensor& f, const torch::Tensor& rate,
                          const torch::Tensor& code) {
      const ops::LawOutput out = ops::learned_law(law, f, rate, code);
      return (G * out.F_proj + S * out.tau).sum();
    };
    const auto g = torch::autograd::grad({loss(F, C, z)},
                                         {F, C, z, law.projection.numbers, law.stress.numbers});
    const auto keep = [&](std::map<std::string, double>& worst, double error) {
      worst[c.group] = std::max(worst[c.group], error);
    };
    keep(errors.F, smooth_gradient_error(g[0], F, c.step,
                                         [&](const torch::Tensor& f) { return loss(f, C, z); }));
    keep(errors.C, smooth_gradient_error(g[1], C, 1e-2,
                                         [&](const torch::Tensor& r) { return loss(F, r, z); }));
    keep(errors.z, smooth_gradient_error(g[2], z, 1e-4,
                                         [&](const torch::Tensor& k) { return loss(F, C, k); }));
    torch::manual_seed(31);
    const torch::Tensor of_projection = torch::randn_like(g[3]),
                        of_stress = torch::randn_like(g[4]);
    const torch::Tensor along =
        ((of_projection * g[3]).sum() + (of_stress * g[4]).sum()).reshape({1});
    keep(errors.weights,
         smooth_gradient_error(
             along, torch::zeros({1}, torch::kFloat64), 1e-6, [&](const torch::Tensor& t) {
               law.projection.numbers = of_case.projection.numbers + t * of_projection;
               law.stress.numbers = of_case.stress.numbers + t * of_stress;
               return loss(F, C, z);
             }));
  }
  return errors;
}

}  // namespace uniphy::testing
