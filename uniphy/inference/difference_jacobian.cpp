#include "uniphy/inference/difference_jacobian.hpp"

#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/for_each.hpp"

namespace uniphy {
namespace {

using torch::Tensor;
using ConstVector = Eigen::Map<const Eigen::VectorXd>;

ConstVector vector_of(const Tensor& t) { return {t.data_ptr<double>(), t.numel()}; }

}  // namespace

double sum_of_squares(const Tensor& residuals) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (!residuals.defined()) return kInfinity;
  const double sum = vector_of(residuals).squaredNorm();
  return std::isfinite(sum) ? sum : kInfinity;
}

DifferenceJacobian difference_jacobian(const Residuals& residuals, const Tensor& point,
                                       const Tensor& residuals_there,
                                       const std::vector<std::int64_t>& columns, double step) {
  const auto n = static_cast<std::ptrdiff_t>(columns.size());
  DifferenceJacobian result{Eigen::MatrixXd::Zero(residuals_there.numel(), n)};
  std::vector<int> calls(columns.size(), 0);
  kernels::for_each(n, [&](std::ptrdiff_t k) {
    const torch::NoGradGuard no_grad;
    for (const double h : {step, -step}) {
      const Tensor moved = point.clone();
      moved.data_ptr<double>()[columns[k]] += h;
      const Tensor there = residuals(moved);
      ++calls[k];
      if (!std::isfinite(sum_of_squares(there))) continue;
      result.J.col(k) = (vector_of(there) - vector_of(residuals_there)) / h;
      return;
    }
  });
  result.evaluations = std::accumulate(calls.begin(), calls.end(), 0);
  return result;
}

Eigen::MatrixXd normal_matrix(const Eigen::MatrixXd& J) {
  // Within a parallel loop Eigen's product runs on one thread: the bits do not depend on how many
  // there are.
  constexpr Eigen::Index kBlocks = 64;
  std::vector<Eigen::MatrixXd> parts(kBlocks);
  kernels::for_each(kBlocks, [&](std::ptrdiff_t b) {
    const Eigen::Index begin = J.rows() * b / kBlocks, end = J.rows() * (b + 1) / kBlocks;
    const auto rows = J.middleRows(begin, end - begin);
    parts[static_cast<std::size_t>(b)] = rows.transpose() * rows;
  });
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(J.cols(), J.cols());
  for (const Eigen::MatrixXd& part : parts) A += part;
  return A;
}

}  // namespace uniphy
