#include "uniphy/inference/fit_posterior.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/for_each.hpp"
#include "uniphy/geometry/random.hpp"

namespace uniphy {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using torch::Tensor;

/// Samples of a chain that are left out: it begins at the point itself.
constexpr int kWarmUp = 2;
/// Points that are tried for a sample; the bracket is halved by each, about.
constexpr int kMostTries = 30;
/// The spread of a direction is shortened, by no less than kMostCut and no more than kLeastCut at
/// once, until twice the logarithm of the posterior falls by no more than kFall there.
constexpr int kSpreadRounds = 6;
constexpr double kFall = 2, kLeastCut = 0.2, kMostCut = 0.7;
/// Step of the differences, in units of u (as LevenbergMarquardtOptions).
constexpr double kDifference = 1e-6;

using ConstVector = Eigen::Map<const VectorXd>;

/// Normal with variance 1 (G. Box and M. Muller, Ann. Math. Stat. 29, 1958).
VectorXd normal(Eigen::Index size, UniformRandom& random) {
  VectorXd result(size);
  for (double& x : result) {
    x = std::sqrt(-2 * std::log(1 - random.unit())) * std::cos(2 * M_PI * random.unit());
  }
  return result;
}

/// The windows of time of the rows of J, [begin, end).
std::vector<std::array<Eigen::Index, 2>> windows_of(Eigen::Index rows, int count) {
  std::vector<std::array<Eigen::Index, 2>> windows;
  for (int w = 0; w < count; ++w) {
    const std::array<Eigen::Index, 2> window{rows * w / count, rows * (w + 1) / count};
    if (window[0] < window[1]) windows.push_back(window);
  }
  return windows;
}

/// φ of scores Jᵀr of windows, each residual with that variance.
double dispersion_of(const MatrixXd& J, const ConstVector& r, double variance, int count) {
  const MatrixXd A = normal_matrix(J) / variance;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(A);
  const auto windows = windows_of(J.rows(), count);
  MatrixXd scores(J.cols(), static_cast<Eigen::Index>(windows.size()));
  for (std::size_t w = 0; w < windows.size(); ++w) {
    const auto [begin, end] = windows[w];
    const VectorXd score =
        J.middleRows(begin, end - begin).transpose() * r.segment(begin, end - begin);
    scores.col(static_cast<Eigen::Index>(w)) = axes.eigenvectors().transpose() * score / variance;
  }
  double sum = 0;
  int told = 0;
  for (Eigen::Index k = 0; k < J.cols(); ++k) {
    if (axes.eigenvalues()[k] <= 1) continue;  // the prior tells more
    sum += scores.row(k).squaredNorm() / axes.eigenvalues()[k];
    ++told;
  }
  const auto G = static_cast<double>(windows.size());
  return told == 0 || G < 2 ? 1 : std::max(1.0, G / (G - 1) * sum / told);
}

/// The posterior of a point moved by f along the columns.
class Posterior {
 public:
  Posterior(const Residuals& residuals, const Tensor& point,
            const std::vector<std::int64_t>& columns, double weight)
      : residuals_(residuals), point_(point), columns_(columns), weight_(weight) {}

  Tensor at(const VectorXd& f) const {
    Tensor u = point_.clone();
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      u.data_ptr<double>()[columns_[k]] += f[static_cast<Eigen::Index>(k)];
    }
    return u;
  }
  /// Its logarithm, but for a constant.
  double log(const VectorXd& f) const {
    return -0.5 * weight_ * sum_of_squares(residuals_(at(f))) - 0.5 * f.squaredNorm();
  }

 private:
  const Residuals& residuals_;
  const Tensor& point_;
  const std::vector<std::int64_t>& columns_;
  double weight_;
};

/// A normal distribution of independent directions: a column of `axes` and a spread for each.
struct Gaussian {
  MatrixXd axes;
  VectorXd spread;
};

/// That of a linear model with information JᵀJ.
Gaussian linear_gaussian(const MatrixXd& information) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(information);
  return {solver.eigenvectors(), solver.eigenvalues().cwiseMax(1).cwiseSqrt().cwiseInverse()};
}

/// Shortens the spreads to where the posterior itself has fallen by about what it has at one of a
/// Gaussian, on the side where it falls less: along a direction in which the slope is nil, the
/// square of a move may tell much. Returns the evaluations.
int fit_spreads(const Posterior& posterior, double top, Gaussian& gaussian) {
  const Eigen::Index n = gaussian.spread.size();
  std::vector<int> evaluations(static_cast<std::size_t>(n), 0);
  kernels::for_each(n, [&](std::ptrdiff_t k) {
    const torch::NoGradGuard no_grad;
    for (int round = 0; round < kSpreadRounds; ++round) {
      double fall = std::numeric_limits<double>::infinity();  // 1 at the spread of a Gaussian
      for (const double side : {1.0, -1.0}) {
        if (fall <= kFall) continue;
        const VectorXd f = side * gaussian.spread[k] * gaussian.axes.col(k);
        fall = std::min(fall, 2 * (top - posterior.log(f)));
        ++evaluations[k];
      }
      if (fall <= kFall) return;
      gaussian.spread[k] *= std::clamp(std::pow(fall, -1.0 / 3), kLeastCut, kMostCut);
    }
  });
  return std::accumulate(evaluations.begin(), evaluations.end(), 0);
}

/// Draws from the posterior about a point.
class SliceSampler {
 public:
  SliceSampler(const Posterior& posterior, const Gaussian& gaussian)
      : posterior_(posterior), gaussian_(gaussian) {}

  /// Log of the posterior over the Gaussian, but for a constant.
  double log_ratio(const VectorXd& f) const {
    const VectorXd along = gaussian_.axes.transpose() * f;
    return posterior_.log(f) + 0.5 * along.cwiseQuotient(gaussian_.spread).squaredNorm();
  }
  /// One step of a chain from f, whose log_ratio is `level`; both are those of the sample after it.
  /// Returns the points tried.
  int step(VectorXd& f, double& level, UniformRandom& random) const {
    const VectorXd other = gaussian_.axes * gaussian_.spread.cwiseProduct(normal(f.size(), random));
    const double threshold = level + std::log(1 - random.unit());
    double angle = 2 * M_PI * random.unit(), low = angle - 2 * M_PI, high = angle;
    for (int tries = 1; tries <= kMostTries; ++tries) {
      const VectorXd next = std::cos(angle) * f + std::sin(angle) * other;
      const double there = log_ratio(next);
      if (there > threshold) {
        f = next;
        level = there;
        return tries;
      }
      (angle < 0 ? low : high) = angle;
      angle = random.between(low, high);
    }
    return kMostTries;
  }

 private:
  const Posterior& posterior_;
  const Gaussian& gaussian_;
};

void add_samples(const Posterior& posterior, const Gaussian& gaussian, double level,
                 const PosteriorOptions& options, FitPosterior& result) {
  const SliceSampler sampler(posterior, gaussian);
  const Eigen::Index size = gaussian.spread.size();
  const int of_chain = options.samples / kPosteriorChains;
  if (of_chain == 0) return;
  std::vector<std::vector<Tensor>> chains(kPosteriorChains);
  std::vector<int> tries(kPosteriorChains, 0);
  std::atomic<int> done{0};
  kernels::for_each(kPosteriorChains, [&](std::ptrdiff_t c) {
    const torch::NoGradGuard no_grad;
    UniformRandom random(static_cast<std::uint64_t>(c) + 1);
    VectorXd f = VectorXd::Zero(size);
    double at = level;
    for (int k = 0; k < kWarmUp + of_chain; ++k) {
      tries[c] += sampler.step(f, at, random);
      if (k >= kWarmUp) chains[c].push_back(posterior.at(f));
      ++done;
      if (c == 0 && options.progress) options.progress(done);
    }
  });
  for (int c = 0; c < kPosteriorChains; ++c) {
    result.evaluations += tries[c];
    result.samples.insert(result.samples.end(), chains[c].begin(), chains[c].end());
  }
}

/// The principal directions of the covariance of the first `size` numbers.
void add_directions(const MatrixXd& covariance, Eigen::Index size, FitPosterior& result) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(covariance.topLeftCorner(size, size));
  result.directions = axes.eigenvectors();
  for (const double square : axes.eigenvalues()) {
    result.spread.push_back(std::sqrt(std::max(square, 0.0)));
    result.determined += result.spread.back() < kDetermined ? 1 : 0;
  }
}

}  // namespace

FitPosterior fit_posterior(const Residuals& residuals, const Tensor& point,
                           const std::vector<std::int64_t>& columns, int motion, double count,
                           const PosteriorOptions& options) {
  const torch::NoGradGuard no_grad;
  FitPosterior result;
  const Tensor there = residuals(point);
  ++result.evaluations;
  if (!std::isfinite(sum_of_squares(there))) return result;
  const DifferenceJacobian slopes =
      difference_jacobian(residuals, point, there, columns, kDifference);
  result.evaluations += slopes.evaluations;
  const MatrixXd& J = slopes.J;
  const Eigen::Index size = J.cols();
  const double freedom = std::max(1.0, count - static_cast<double>(size));
  const double variance =  // of a coordinate
      std::max({sum_of_squares(there) * count / freedom, options.noise * options.noise,
                kLeastError * kLeastError});
  const ConstVector r(there.data_ptr<double>(), there.numel());
  result.dispersion = dispersion_of(J, r, variance / count, options.windows);
  const double weight = 1 / (variance * result.dispersion / count + kLawError * kLawError);
  const Posterior posterior(residuals, point, columns, weight);
  const double top = -0.5 * weight * sum_of_squares(there);
  Gaussian gaussian = linear_gaussian(weight * normal_matrix(J) + MatrixXd::Identity(size, size));
  result.evaluations += fit_spreads(posterior, top, gaussian);
  const MatrixXd spread = gaussian.axes * gaussian.spread.asDiagonal();
  // Eigen's other product may have the bits of a number of threads.
  add_directions(spread.lazyProduct(spread.transpose()), size - motion, result);
  add_samples(posterior, gaussian, top, options, result);
  return result;
}

}  // namespace uniphy
