#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "ops/base/torch.hpp"
#include "tests/support/finite_differences.hpp"
#include "tests/support/law_cases.hpp"

namespace uniphy::testing {

/// Matrices as a tensor [P, 3, 3], float64.
inline torch::Tensor to_tensor(const std::vector<Matrix>& matrices) {
  const torch::Tensor t =
      torch::empty({static_cast<int64_t>(matrices.size()), 3, 3}, torch::kFloat64);
  double* at = t.data_ptr<double>();
  for (const Matrix& m : matrices) at = std::copy(m.begin(), m.end(), at);
  return t;
}

/// The deformation gradients of cases_of, those with a group in `without` left out.
inline torch::Tensor case_tensor(const kernels::LawDescription& d,
                                 const std::vector<std::string>& without = {}) {
  std::vector<Matrix> all;
  for (const DeformationCase& c : cases_of(d)) {
    if (std::find(without.begin(), without.end(), c.group) == without.end()) all.push_back(c.F);
  }
  return to_tensor(all);
}

/// max |a − b| / max |b|
inline double relative_difference(const torch::Tensor& a, const torch::Tensor& b) {
  const double size = b.abs().max().item<double>();
  return (a - b).abs().max().item<double>() / (size > 0 ? size : 1);
}

/// What the backward pass of the op that made `result` answers to these gradients of its results;
/// one for each tensor that the op was given.
inline torch::autograd::variable_list answer_of_backward(const torch::Tensor& result,
                                                         torch::autograd::variable_list gradients) {
  const torch::NoGradGuard guard;
  return (*result.grad_fn())(std::move(gradients));
}

/// The gradient of the scalar f at x by central differences, as a tensor like x.
template <class Function>
torch::Tensor numerical_gradient(const Function& f, const torch::Tensor& x, double step) {
  const torch::Tensor at = x.detach().clone().contiguous();
  const std::vector<double> start(at.data_ptr<double>(), at.data_ptr<double>() + at.numel());
  const auto value = [&](const std::vector<double>& v) {
    std::copy(v.begin(), v.end(), at.data_ptr<double>());
    return f(at).template item<double>();
  };
  const std::vector<double> g =
      central_differences(value, start, std::vector<double>(start.size(), step));
  return torch::tensor(g, torch::kFloat64).view(x.sizes());
}

}  // namespace uniphy::testing
