#include "uniphy/stability/gradient_check.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/statistics.hpp"
#include "ops/kernels/spectral/limits.hpp"
#include "ops/spectral/svd3.hpp"
#include "uniphy/geometry/random.hpp"

namespace uniphy::stability {
namespace {

using torch::Tensor;

constexpr std::int64_t kStatesAtOnce = 4096;  // about 20 MB of temporaries
/// Two differences of a smooth function agree to about 1e-9; 1e-6 leaves room, and an error of
/// kGradientTolerance still stands out.
constexpr double kAgreement = 1e-6;
/// Functions and weights are of order one: below this a gradient counts as 0.
constexpr double kLeastNorm = 1e-3;

/// One number a state.
Tensor norms(const Tensor& g) { return g.flatten(1).square().sum(1).sqrt(); }

Tensor weights(const Tensor& like, UniformRandom& random) {
  Tensor w = torch::empty_like(like);
  double* at = w.data_ptr<double>();
  for (std::int64_t k = 0; k < w.numel(); ++k) at[k] = random.between(-1, 1);
  return w;
}

/// Fourth-order central differences by every entry of F with steps h and h/2, [P, 9] each.
std::pair<Tensor, Tensor> differences(const StateFunction& f, const Tensor& F, const Tensor& w,
                                      const Tensor& h) {
  const Tensor flat = F.view({-1, 9});
  const auto loss = [&](int entry, double shift) {
    Tensor moved = flat.clone();
    moved.select(1, entry).add_(h * shift);
    return (f(moved.view({-1, 3, 3})) * w).sum(1);
  };
  std::vector<Tensor> wide, narrow;
  for (int k = 0; k < 9; ++k) {
    const Tensor two = loss(k, 2) - loss(k, -2), one = loss(k, 1) - loss(k, -1),
                 half = loss(k, 0.5) - loss(k, -0.5);
    wide.push_back((8 * one - two) / (12 * h));
    narrow.push_back((8 * half - one) / (6 * h));
  }
  return {torch::stack(wide, 1), torch::stack(narrow, 1)};
}

struct Tally {
  std::int64_t states = 0, finite = 0, judged = 0, with_derivative = 0, left_out = 0, zeroed = 0;
  double largest = 0, squared_error = 0, squared_size = 0;
  std::vector<double> errors;
  Failure failure;
  double failed_error = 0;

  void fail(std::int64_t row, const std::string& cause) {
    if (failure.particle < 0) failure = {-1, row, cause};
  }
};

void judge(const Tensor& g, const Tensor& reference, const Tensor& agrees, const Tensor& jumps,
           Tally& t) {
  const Tensor finite = torch::isfinite(g).flatten(1).all(1);
  const Tensor miss = norms(g - reference), expected = norms(reference);
  const Tensor error = miss / expected.clamp_min(kLeastNorm);
  const Tensor size = g.abs().flatten(1).amax(1);
  const auto is_finite = finite.accessor<bool, 1>(), agree = agrees.accessor<bool, 1>(),
             jump = jumps.accessor<bool, 1>();
  const auto e = error.accessor<double, 1>(), s = size.accessor<double, 1>(),
             m = miss.accessor<double, 1>(), x = expected.accessor<double, 1>();
  for (std::int64_t p = 0; p < g.size(0); ++p) {
    const std::int64_t row = t.states++;
    if (is_finite[p]) {
      ++t.finite;
      t.largest = std::max(t.largest, s[p]);
    } else {
      t.fail(row,
             "its gradient is not finite: two singular values are equal, and the derivative "
             "of U and V divides by the difference of their squares");
    }
    if (jump[p]) {
      ++t.left_out;
      continue;
    }
    ++t.judged;
    if (!agree[p]) continue;
    ++t.with_derivative;
    if (!is_finite[p]) continue;
    t.errors.push_back(e[p]);
    t.squared_error += m[p] * m[p];
    t.squared_size += x[p] * x[p];
    if (!(e[p] <= kGradientTolerance))
      t.fail(row, fmt::format("its gradient is wrong by {:.2g} of its size", e[p]));
  }
}

}  // namespace

void check_gradients(const std::vector<double>& all, const GradientCheck& check, Cell& cell) {
  const auto count = static_cast<std::int64_t>(all.size() / 9);
  UniformRandom random(check.seed);
  Tally t;
  for (std::int64_t first = 0; first < count; first += kStatesAtOnce) {
    const std::int64_t rows = std::min(kStatesAtOnce, count - first);
    const Tensor F =
        torch::from_blob(const_cast<double*>(&all[static_cast<std::size_t>(9 * first)]),
                         {rows, 3, 3}, torch::kFloat64)
            .clone();
    const Tensor variable = F.clone().requires_grad_();
    const Tensor value = check.function(variable);
    const Tensor w = weights(value.detach(), random);
    Tensor g = torch::autograd::grad({(value * w).sum()}, {variable})[0].detach();
    if (check.zero_not_finite) {
      t.zeroed += torch::isfinite(g).logical_not().sum().item<std::int64_t>();
      g = torch::nan_to_num(g, 0, 0, 0);
    }
    const torch::NoGradGuard no_grad;
    if (check.exact) {
      const Tensor no = torch::zeros({rows}, torch::kBool);
      judge(g, check.exact(F, w.view({-1, 3, 3})), no.logical_not(), no, t);
      continue;
    }
    const Tensor sigma = ops::svd3(F).sigma;
    const Tensor sum = (sigma.select(1, 1) + sigma.select(1, 2)).abs();
    const Tensor h = 1e-3 * sum.clamp(kernels::kLeastSum, 0.1);
    const auto [wide, narrow] = differences(check.reference, F, w, h);
    const Tensor agrees = norms(wide - narrow) <= kAgreement * norms(narrow).clamp_min(kLeastNorm);
    judge(g, narrow.view({-1, 3, 3}), agrees, sum <= kernels::kLeastSum * 1.01, t);
  }

  const auto share = [](std::int64_t part, std::int64_t whole) {
    return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 1.0;
  };
  const double finite = share(t.finite, t.states), there = share(t.with_derivative, t.judged);
  const double worst = t.errors.empty() ? 0 : *std::max_element(t.errors.begin(), t.errors.end());
  cell.deciding = "gradient_error";
  cell.set("gradient_error", t.judged > 0 && t.errors.empty() ? std::nan("") : worst);
  cell.set("gradient_error_median", kernels::median(t.errors));
  cell.set("gradient_error_together",
           t.squared_size > 0 ? std::sqrt(t.squared_error / t.squared_size) : std::nan(""));
  cell.set("finite_share", finite);
  cell.set("derivative_share", there);
  cell.set("left_out_share", share(t.left_out, t.states));
  cell.set("gradient_max", t.largest);
  cell.set("states", static_cast<double>(t.states));
  if (check.zero_not_finite) cell.set("zeroed", static_cast<double>(t.zeroed));
  const bool exists = there >= kDerivativeShare;
  cell.verdict =
      finite == 1 && worst <= kGradientTolerance && exists ? Verdict::holds : Verdict::fails;
  if (cell.verdict == Verdict::holds) return;
  cell.failure = t.failure;
  if (t.failure.particle < 0) {
    cell.failure.cause = fmt::format(
        "{:.3g} of the states have no derivative: the value itself jumps there, differences with "
        "two steps disagree",
        1 - there);
  }
}

Tensor polar_rotation_gradient(const Tensor& F, const Tensor& G) {
  using Matrix = Eigen::Matrix<long double, 3, 3>;
  using Vector = Eigen::Matrix<long double, 3, 1>;
  Tensor out = torch::empty_like(F);
  const Tensor f = F.contiguous(), g = G.contiguous();
  const auto read = [](const Tensor& t, std::int64_t p) {
    Matrix m;
    for (int k = 0; k < 9; ++k) m(k / 3, k % 3) = t.data_ptr<double>()[9 * p + k];
    return m;
  };
  for (std::int64_t p = 0; p < F.size(0); ++p) {
    const Matrix A = read(f, p);
    Matrix R = A;
    // Quadratic from the first step on: F is within a few per cent of a rotation here.
    for (int i = 0; i < 12; ++i) R = 0.5L * (R + Matrix(R.inverse().transpose()));
    const Matrix S = R.transpose() * A, Y = R.transpose() * read(g, p);
    const Vector a(0.5L * (Y(2, 1) - Y(1, 2)), 0.5L * (Y(0, 2) - Y(2, 0)),
                   0.5L * (Y(1, 0) - Y(0, 1)));
    const Matrix M = S.trace() * Matrix::Identity() - S;
    const Vector w = M.inverse() * a;
    Matrix cross;
    cross << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0;
    const Matrix result = 2 * R * cross;
    for (int k = 0; k < 9; ++k)
      out.data_ptr<double>()[9 * p + k] = static_cast<double>(result(k / 3, k % 3));
  }
  return out;
}

}  // namespace uniphy::stability
