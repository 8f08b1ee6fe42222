#pragma once

#include <gtest/gtest.h>

#include <array>

#include "ops/kernels/laws/law_parameters.hpp"
#include "ops/laws/material.hpp"
#include "tests/support/on_threads.hpp"
#include "tests/support/tensors.hpp"

namespace uniphy::testing {

/// A material whose parameters are leaves that gradients reach.
struct MaterialLeaves {
  std::array<torch::Tensor, kernels::kLawParameters> leaves;

  explicit MaterialLeaves(const kernels::LawDescription& d) {
    for (const kernels::LawParameter& p : kernels::kLawParameterTable)
      leaves[p.place] = torch::scalar_tensor(d.*p.member, torch::kFloat64).set_requires_grad(true);
  }
  ops::Material material() const {
    ops::Material material;
    for (int i = 0; i < kernels::kLawParameters; ++i)
      material.*ops::kMaterialMembers[i] = leaves[i];
    return material;
  }
  /// dL/d(log parameter), so that pascals and radians compare; 0 where undefined.
  torch::Tensor gradient(const torch::Tensor& loss) const {
    const auto g = torch::autograd::grad({loss}, {leaves.begin(), leaves.end()}, {}, true, false,
                                         /*allow_unused=*/true);
    std::vector<double> all;
    for (int i = 0; i < kernels::kLawParameters; ++i)
      all.push_back(g[i].defined() ? g[i].item<double>() * leaves[i].item<double>() : 0);
    return torch::tensor(all, torch::kFloat64);
  }
};

/// The gradient of (op(F) W).sum() by F against central differences, at states where torch's own
/// SVD gives NaN too. `floor` is a norm of gradients that is small for the op.
template <class Op>
void expect_gradient_by_differences(const kernels::LawDescription& d, double floor, const Op& op) {
  for (const DeformationCase& c : cases_of(d)) {
    const torch::Tensor F = to_tensor({c.F}).set_requires_grad(true);
    const torch::Tensor W = torch::randn_like(F);
    const auto loss = [&](const torch::Tensor& f) { return (op(f) * W).sum(); };
    loss(F).backward();
    const torch::Tensor differences = numerical_gradient(loss, F, c.step);
    EXPECT_LE((F.grad() - differences).norm().item<double>(),
              1e-6 * std::max(differences.norm().item<double>(), floor))
        << c.group;
  }
}

/// op(F, material) and its gradients by both have the same bits on one thread and on two.
template <class Op>
void expect_same_bits_on_threads(const kernels::LawDescription& d, const Op& op) {
  const torch::Tensor F =
      (torch::eye(3) + 0.2 * torch::randn({5000, 3, 3})).set_requires_grad(true);
  const torch::Tensor W = torch::randn_like(F);
  const auto run = [&] {
    const MaterialLeaves leaves(d);
    const torch::Tensor result = op(F, leaves.material());
    const torch::Tensor loss = (result * W).sum();
    return std::vector<torch::Tensor>{
        result.detach(), torch::autograd::grad({loss}, {F}, {}, true)[0], leaves.gradient(loss)};
  };
  const auto one = on_threads(1, run), two = on_threads(2, run);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_TRUE(torch::equal(one[i], two[i])) << i;
  }
}

/// The states where autograd through torch's SVD has a gradient to compare with.
inline torch::Tensor separated_states() {
  std::mt19937_64 random(53);
  std::vector<Matrix> all;
  for (const Matrix& s :
       {diagonal(1.6, 1.1, 0.7), diagonal(0.95, 0.9, 0.85), diagonal(1.2, 1.0, 0.8),
        diagonal(1.3, 1.2, 1.1), diagonal(1.05, 1.0, 0.96), diagonal(0.9, 0.7, 0.3),
        diagonal(1.01, 0.99, 0.98), diagonal(1.4, 0.8, 0.1)}) {
    for (int i = 0; i < 4; ++i)
      all.push_back(composed(random_rotation(random), s, random_rotation(random)));
  }
  return to_tensor(all);
}

class AnalyticLaws : public ::testing::TestWithParam<kernels::LawId> {
 protected:
  kernels::LawId id() const { return GetParam(); }
  kernels::LawDescription description() const { return sample_law(id()); }
};

}  // namespace uniphy::testing
