#pragma once

#include <vector>

#include "ops/base/torch.hpp"
#include "ops/loss/law_losses.hpp"
#include "tests/support/law_loss_cases.hpp"
#include "tests/support/tensors.hpp"

namespace uniphy::testing {

/// The inputs of the ops; those with a gradient are z, caps, caps_rest, moduli, moduli_rest.
struct LawLossInputs {
  ops::IsotropicBatch batch;
  torch::Tensor scales, seed;
  std::vector<torch::Tensor> leaves;
  ops::ErrorMeasure measure;

  LawLossInputs(const LawLossCase& c, torch::Dtype type) : measure{c.floor, c.delta} {
    const auto tensor = [type](const std::vector<double>& v, std::vector<std::int64_t> sizes) {
      return torch::tensor(v, torch::kFloat64).view(sizes).to(type);
    };
    const std::int64_t n = c.trajectories, m = c.samples;
    batch = {tensor(c.columns, {c.table, kernels::SampleColumns::count}),
             torch::tensor(c.rows, torch::kInt64).view({n, m})};
    scales = tensor(c.scales, {n, 4});
    using kernels::kCapOutputs, kernels::kStressOutputs;
    leaves = {tensor(c.z, {n, c.latent}), tensor(c.caps, {n, c.state_caps ? m : 1, kCapOutputs}),
              tensor(c.caps_rest, {n, 1, kCapOutputs}),
              tensor(c.moduli, {n, c.state_moduli ? m : 1, kStressOutputs}),
              tensor(c.moduli_rest, {n, 1, kStressOutputs})};
    for (torch::Tensor& t : leaves) t.requires_grad_();
    torch::manual_seed(3);
    seed = torch::randn({n, kernels::kIsotropicLosses}, torch::kFloat64).to(type);
  }
  /// of: the op, or its reference.
  ops::LawLosses errors(decltype(&ops::law_losses) of = &ops::law_losses) const {
    return of(batch, scales, leaves[0], {leaves[1], leaves[2], leaves[3], leaves[4]}, measure);
  }
  std::vector<torch::Tensor> gradients(decltype(&ops::law_losses) of = &ops::law_losses) const {
    return torch::autograd::grad({(seed * errors(of).losses).sum()}, leaves, {}, c10::nullopt,
                                 false, /*allow_unused=*/true);
  }
};

/// Relative errors of the op's gradients against central differences in float64, by
/// LawLossInputs::leaves. The share weighs a missed cap as a constant, which differences do
/// not know: only samples that the law cuts.
inline std::vector<double> isotropic_gradient_errors(LawLossCase c) {
  for (std::int64_t& row : c.rows) row = row % 3 == 0 ? row + 1 : row;
  LawLossInputs in(c, torch::kFloat64);
  const std::vector<torch::Tensor> got = in.gradients();
  const torch::NoGradGuard guard;
  std::vector<double> errors;
  for (std::size_t k = 0; k < got.size(); ++k) {
    const torch::Tensor keep = in.leaves[k];
    const torch::Tensor want = numerical_gradient(
        [&](const torch::Tensor& at) {
          in.leaves[k] = at;
          return (in.seed * in.errors().losses).sum();
        },
        keep, 1e-5);
    in.leaves[k] = keep;
    errors.push_back(relative_difference(got[k], want));
  }
  return errors;
}

}  // namespace uniphy::testing
