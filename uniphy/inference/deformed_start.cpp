#include "uniphy/inference/deformed_start.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "ops/base/torch.hpp"
#include "uniphy/inference/initial_fields.hpp"
#include "uniphy/inference/misfit.hpp"
#include "uniphy/inference/observed_noise.hpp"

namespace uniphy {
namespace {

using Eigen::MatrixXd;

/// Frames that tell the velocity where there is no noise, and the most that are looked at.
constexpr int kLeastFrames = 2, kMostFrames = 32;
/// Over size: what the first frames of a polynomial motion may miss without noise.
constexpr double kLeastMiss = 1e-4;
/// m, of positions in float32.
constexpr double kRounding = 6e-8;

/// Least squares of displacements on t m_k and ½ t² m_k.
struct VelocityFit {
  MatrixXd coefficients;   ///< [terms, 3] m/s
  Eigen::VectorXd spread;  ///< [terms] of one of them for errors of 1 m
  double miss = 0;         ///< m, root of the mean square of a coordinate
};

/// By the normal equations, a frame after the other: points may be many.
VelocityFit fit_velocity(const Observation& o, const MatrixXd& terms,
                         const std::vector<double>& start, int frames) {
  const Eigen::Index n = terms.cols(), unknown = frames > 1 ? 2 * n : n;
  MatrixXd A = MatrixXd::Zero(unknown, unknown), b = MatrixXd::Zero(unknown, 3);
  double square = 0, count = 0;
  for (std::int64_t f = 1; f <= frames; ++f) {
    const double t = o.time[f] - o.time[0];
    for (std::int64_t p = 0; p < o.points(); ++p) {
      if (!o.is_seen(f, p) || std::isnan(start[3 * p])) continue;
      Eigen::VectorXd row(unknown);
      row.head(n) = t * terms.row(p).transpose();
      if (unknown > n) row.tail(n) = 0.5 * t * t * terms.row(p).transpose();
      const Eigen::RowVector3d moved =
          Eigen::Map<const Eigen::RowVector3d>(o.positions(f) + 3 * p) -
          Eigen::Map<const Eigen::RowVector3d>(&start[3 * p]);
      A += row * row.transpose();
      b += row * moved;
      square += moved.squaredNorm();
      count += 3;
    }
  }
  // Columns of one length: t is small against 1. Few points do not tell every term: those are 0.
  const Eigen::VectorXd scale = A.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> solver;
  solver.setThreshold(1e-12);
  solver.compute(scale.asDiagonal() * A * scale.asDiagonal());
  const MatrixXd inverse = scale.asDiagonal() * solver.pseudoInverse() * scale.asDiagonal();
  const MatrixXd solution = inverse * b;
  VelocityFit fit;
  fit.coefficients = solution.topRows(n);
  const double left = square - solution.cwiseProduct(b).sum();
  fit.miss = count > 0 ? std::sqrt(std::max(left, 0.0) / count) : 0;
  fit.spread = inverse.diagonal().head(n).cwiseMax(0).cwiseSqrt();
  return fit;
}

/// The state with those coefficients as its velocity and no stretch, and what its numbers are known
/// to; `miss`: of a displacement, m.
MotionEstimate estimate_of(InitialState state, const VelocityFit& fit, double miss) {
  const MatrixXd& b = fit.coefficients;
  const Eigen::Matrix3d gradient = b.middleRows(1, 3).transpose() / state.radius;
  const Eigen::Matrix3d D = 0.5 * (gradient + gradient.transpose());
  state.linear = b.row(0);
  state.angular =
      0.5 * Eigen::Vector3d(gradient(2, 1) - gradient(1, 2), gradient(0, 2) - gradient(2, 0),
                            gradient(1, 0) - gradient(0, 1));
  state.numbers = {D(0, 0), D(1, 1), D(2, 2), D(0, 1), D(0, 2), D(1, 2)};
  const double of_gradient = miss * fit.spread.segment(1, 3).maxCoeff() / state.radius;
  MotionEstimate estimate;
  std::vector<double>& spread = estimate.spread;
  spread.assign(3, miss * fit.spread[0]);
  spread.resize(12, of_gradient);
  for (Eigen::Index k = 4; k < b.rows(); ++k) {
    for (int c = 0; c < 3; ++c) {
      state.numbers.push_back(b(k, c));
      spread.push_back(miss * fit.spread[k]);
    }
  }
  const auto all = static_cast<std::size_t>(initial_numbers(state.degree));
  state.numbers.resize(all - 6, 0.0);
  spread.resize(all, kStretchSpread);
  estimate.motion = state;
  return estimate;
}

}  // namespace

MotionEstimate estimate_deformed_start(const Observation& o) {
  const double size = observed_size(o), noise = observed_noise(o);
  InitialState state;
  state.degree = o.start_degree;
  state.centre = centre_of_mass(o);
  state.radius = 0.5 * size;
  const std::vector<double> start = o.tracked() ? o.tracers : o.start();
  const torch::Tensor arm =
      (torch::tensor(start, torch::kFloat64).view({-1, 3}) -
       torch::tensor({state.centre[0], state.centre[1], state.centre[2]}, torch::kFloat64)) /
      state.radius;
  const torch::Tensor value = monomials(arm, state.degree).value.t().contiguous();
  const MatrixXd terms =
      Eigen::Map<const MatrixXd>(value.data_ptr<double>(), value.size(1), value.size(0));
  const auto last = static_cast<int>(std::min<std::int64_t>(kMostFrames, o.frames - 1));
  int frames = std::min(kLeastFrames, last);
  VelocityFit fit = fit_velocity(o, terms, start, frames);
  const double allowed = std::max(kNoiseAllowance * std::sqrt(2.0) * noise, kLeastMiss * size);
  while (noise > 0 && frames < last) {
    const int more = std::min(2 * frames, last);
    const VelocityFit next = fit_velocity(o, terms, start, more);
    if (next.miss > allowed) break;
    frames = more;
    fit = next;
  }
  return estimate_of(state, fit, std::sqrt(1.0 + frames) * std::max(fit.miss, kRounding));
}

}  // namespace uniphy
