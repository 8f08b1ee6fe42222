#pragma once

#include <torch/types.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "uniphy/inference/difference_jacobian.hpp"

namespace uniphy {

/// What an observation says about the numbers of a fit: a Gaussian about the point found, and
/// points drawn from the posterior itself.
struct FitPosterior {
  /// [numbers] standard deviations of the principal directions of the fitted numbers, those of the
  /// initial velocity integrated out, ascending, in the units of u; 1 is what the prior says.
  std::vector<double> spread;
  Eigen::MatrixXd directions;  ///< [numbers, numbers], a column for each, of length 1
  /// Directions with a spread below kDetermined: 0 where the motion tells nothing.
  int determined = 0;
  /// ≥ 1: how much larger the variance of the scores of windows of time is than independent errors
  /// of the size of the residuals make it.
  double dispersion = 1;
  std::vector<torch::Tensor> samples;  ///< points, all numbers and the initial velocity
  int evaluations = 0;                 ///< roll-outs
};

/// Chains of samples, side by side.
inline constexpr int kPosteriorChains = 8;
/// A direction whose standard deviation is below this part of that of the prior is determined.
inline constexpr double kDetermined = 0.5;

struct PosteriorOptions {
  int samples = 64;  ///< a multiple of kPosteriorChains
  /// Rows of a Jacobian that are next to each other in time are in one window.
  int windows = 10;
  double noise = 0;  ///< of a coordinate, in the unit of ‖r‖; 0: not known
  std::function<void(int done)> progress = {};  ///< samples, those of the warm-up among them
};

/// Of residuals r, in order of time, ‖r‖² the mean square of `count` coordinates, about `point`,
/// where they are smallest.
///
/// The prior is a normal distribution of spread 1 about the point; of it only the `columns` of the
/// point are free, the last `motion` of which are the initial velocity. The likelihood is that of
/// independent normal errors of the size of the residuals (not less than the noise, nor than
/// kLeastError), with its logarithm divided by the dispersion φ (quasi-likelihood; P. McCullagh and
/// J. Nelder, Generalized Linear Models, 1989, ch. 9): where the law, the grid or the time step are
/// what is wrong, errors are alike from frame to frame and tell less than their number. φ is the
/// mean over the directions that the data determine of what the scores of windows of time scatter
/// by, over what they would (the sandwich of robust covariances; K.-Y. Liang and S. Zeger,
/// Biometrika 73, 1986).
///
/// To that comes kLawError, as one error of all points and frames.
///
/// The Gaussian has the axes of JᵀJ and the prior; along each its spread is what a linear model
/// says, or less where the posterior itself falls faster: where a slope is nil, the square of a
/// move may tell much. Samples correct it further, in particular for a material that begins to
/// yield a little beyond what was seen, which shows on one side alone: elliptical slice sampling
/// (I. Murray, R. Adams and D. MacKay, AISTATS 2010) with the Gaussian as its prior,
/// kPosteriorChains chains side by side. The same bits on any number of threads. Empty where there
/// are no residuals at the point.
FitPosterior fit_posterior(const Residuals& residuals, const torch::Tensor& point,
                           const std::vector<std::int64_t>& columns, int motion, double count,
                           const PosteriorOptions& options);

/// Over size: to what a learned law follows a motion of a material of its family that it was not
/// trained on, in the middle (README); no number of points and frames averages it out.
inline constexpr double kLawError = 1e-4;

/// Over size: what double roll-outs and float32 files leave.
inline constexpr double kLeastError = 1e-6;

}  // namespace uniphy
