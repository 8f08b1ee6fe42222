#pragma once

#include <gtest/gtest.h>

#include <array>

#include "ops/laws/material.hpp"
#include "tests/support/tensors.hpp"

namespace uniphy::testing {

/// A material whose five parameters are leaves that gradients reach.
struct MaterialLeaves {
  std::array<torch::Tensor, 5> leaves;

  explicit MaterialLeaves(const kernels::LawDescription& d) {
    const double values[] = {d.mu, d.lambda, d.tau_y, d.theta, d.eta};
    for (int i = 0; i < 5; ++i)
      leaves[i] = torch::scalar_tensor(values[i], torch::kFloat64).set_requires_grad(true);
  }
  ops::Material material() const { return {leaves[0], leaves[1], leaves[2], leaves[3], leaves[4]}; }
  /// dL/d(log parameter), so that pascals and radians compare; 0 where undefined.
  torch::Tensor gradient(const torch::Tensor& loss) const {
    const auto g = torch::autograd::grad({loss}, {leaves.begin(), leaves.end()}, {}, true, false,
                                         /*allow_unused=*/true);
    std::vector<double> all;
    for (int i = 0; i < 5; ++i)
      all.push_back(g[i].defined() ? g[i].item<double>() * leaves[i].item<double>() : 0);
    return torch::tensor(all, torch::kFloat64);
  }
};

inline ops::Material numbers(const kernels::LawDescription& d) {
  return {d.mu, d.lambda, d.tau_y, d.theta, d.eta};
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
