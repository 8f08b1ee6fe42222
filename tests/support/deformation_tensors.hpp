#pragma once

#include <algorithm>
#include <random>
#include <vector>

#include "ops/base/torch.hpp"
#include "tests/support/law_cases.hpp"

namespace uniphy::testing {

/// [P, 3, 3], float64.
inline torch::Tensor tensor_of(const std::vector<Matrix>& all) {
  torch::Tensor t = torch::empty({int64_t(all.size()), 3, 3}, torch::kFloat64);
  for (std::size_t p = 0; p < all.size(); ++p)
    std::copy(all[p].begin(), all[p].end(), t.data_ptr<double>() + 9 * p);
  return t;
}

/// Random rotations around singular values exp(strain · normal).
inline torch::Tensor generic_deformations(int count, double strain, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, strain);
  std::vector<Matrix> all;
  for (int p = 0; p < count; ++p) {
    const auto sigma =
        diagonal(std::exp(normal(random)), std::exp(normal(random)), std::exp(normal(random)));
    all.push_back(composed(random_rotation(random), sigma, random_rotation(random)));
  }
  return tensor_of(all);
}

/// ‖a − b‖/‖b‖.
inline double relative(const torch::Tensor& a, const torch::Tensor& b) {
  return (a - b).norm().item<double>() / std::max(b.norm().item<double>(), 1e-300);
}

}  // namespace uniphy::testing
