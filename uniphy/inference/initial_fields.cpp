#include "uniphy/inference/initial_fields.hpp"

#include <algorithm>
#include <array>

#include "ops/base/torch.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr int kSymmetric = 6;  // numbers

/// Exponents of the monomials up to a degree, those of lower degree first.
std::vector<std::array<int, 3>> exponents(int degree) {
  std::vector<std::array<int, 3>> result;
  for (int d = 0; d <= degree; ++d) {
    for (int i = d; i >= 0; --i) {
      for (int j = d - i; j >= 0; --j) result.push_back({i, j, d - i - j});
    }
  }
  return result;
}

/// [..., 6] → [..., 3, 3].
Tensor symmetric(const Tensor& six) {
  const auto at = [&](int k) { return six.select(-1, k); };
  return torch::stack({at(0), at(3), at(4), at(3), at(1), at(5), at(4), at(5), at(2)}, -1)
      .unflatten(-1, {3, 3});
}

/// The matrix of ω ×.
Tensor cross_matrix(const Tensor& angular) {
  const Tensor none = torch::zeros({}, torch::kFloat64);
  const auto w = [&](int k) { return angular[k]; };
  return torch::stack({none, -w(2), w(1), w(2), none, -w(0), -w(1), w(0), none}).view({3, 3});
}

}  // namespace

Tensor numbers_of(const InitialState& state) {
  std::vector<double> all(state.linear.data(), state.linear.data() + 3);
  all.insert(all.end(), state.angular.data(), state.angular.data() + 3);
  all.insert(all.end(), state.numbers.begin(), state.numbers.end());
  return torch::tensor(all, torch::kFloat64);
}

InitialState with_numbers(const InitialState& state, const Tensor& numbers) {
  InitialState s = state;
  const Tensor all = numbers.detach().contiguous();
  const double* at = all.data_ptr<double>();
  std::copy_n(at, 3, s.linear.data());
  std::copy_n(at + 3, 3, s.angular.data());
  s.numbers.assign(at + initial_numbers(0), at + all.numel());
  return s;
}

Monomials monomials(const Tensor& r, int degree) {
  std::vector<Tensor> values, slopes;
  for (const std::array<int, 3>& e : exponents(degree)) {
    std::array<Tensor, 3> power, slope;
    for (int c = 0; c < 3; ++c) {
      const Tensor x = r.select(1, c);
      power[c] = x.pow(e[c]);
      slope[c] = e[c] == 0 ? torch::zeros_like(x) : e[c] * x.pow(e[c] - 1);
    }
    values.push_back(power[0] * power[1] * power[2]);
    slopes.push_back(torch::stack({slope[0] * power[1] * power[2], power[0] * slope[1] * power[2],
                                   power[0] * power[1] * slope[2]},
                                  1));
  }
  return {torch::stack(values, 1), torch::stack(slopes, 2)};
}

InitialBasis::InitialBasis(const std::vector<double>& x, std::int64_t particles,
                           const InitialState& state)
    : degree_(state.degree), particles_(particles) {
  const Eigen::Vector3d& c = state.centre;
  arm_ = torch::tensor(x, torch::kFloat64).view({-1, 3}) -
         torch::tensor({c[0], c[1], c[2]}, torch::kFloat64);
  if (degree_ == 0) return;
  const Monomials all = monomials(arm_ / state.radius, degree_);
  monomials_ = all.value;
  slopes_ = all.slope.slice(2, monomial_count(1)) / state.radius;
}

InitialFields InitialBasis::fields(const Tensor& numbers) const {
  const Tensor linear = numbers.slice(0, 0, 3), angular = numbers.slice(0, 3, initial_numbers(0));
  if (degree_ == 0) return {linear + torch::cross(angular.expand_as(arm_), arm_, 1), {}, {}};
  const std::int64_t velocities = velocity_numbers(degree_), points = arm_.size(0);
  const Tensor gradient =
      symmetric(numbers.slice(0, initial_numbers(0), initial_numbers(0) + kSymmetric)) +
      cross_matrix(angular);
  const Tensor b = numbers.slice(0, initial_numbers(0) + kSymmetric, velocities).view({-1, 3});
  InitialFields f;
  f.v = linear + arm_.mm(gradient.t()) + monomials_.slice(1, monomial_count(1)).mm(b);
  f.C = gradient + slopes_.matmul(b).transpose(1, 2);
  const Tensor H = numbers.slice(0, velocities).view({-1, kSymmetric});
  const Tensor stretch = symmetric(monomials_.slice(0, 0, particles_).mm(H)).matrix_exp();
  const Tensor rest = torch::eye(3, torch::kFloat64).expand({points - particles_, 3, 3});
  f.F = points > particles_ ? torch::cat({stretch, rest}) : stretch;
  return f;
}

InitialFields fields_of(const InitialState& state, const std::vector<double>& x,
                        std::int64_t particles) {
  const torch::NoGradGuard no_grad;
  return InitialBasis(x, particles, state).fields(numbers_of(state));
}

}  // namespace uniphy
