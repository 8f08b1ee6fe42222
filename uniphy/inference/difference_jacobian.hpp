#pragma once

#include <torch/types.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

namespace uniphy {

/// The residuals [M], float64, at a point [N], float64. Undefined where there are none (the
/// roll-out failed). Is called by several threads at the same time.
using Residuals = std::function<torch::Tensor(const torch::Tensor& point)>;

/// ‖r‖², infinite where there are none.
double sum_of_squares(const torch::Tensor& residuals);

struct DifferenceJacobian {
  Eigen::MatrixXd J;  ///< [M, columns]
  int evaluations = 0;
};

/// dr/du of the numbers `columns` of a point, where the residuals are known, by forward differences
/// of that step, an evaluation each, side by side (kernels::for_each). Where a point a step further
/// on has no residuals, the one a step back is taken; a column without either is 0.
DifferenceJacobian difference_jacobian(const Residuals& residuals, const torch::Tensor& point,
                                       const torch::Tensor& residuals_there,
                                       const std::vector<std::int64_t>& columns, double step);

/// JᵀJ, with the same bits on any number of threads.
Eigen::MatrixXd normal_matrix(const Eigen::MatrixXd& J);

}  // namespace uniphy
