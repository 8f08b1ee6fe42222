#pragma once

#include <torch/optim/optimizer.h>
#include <torch/types.h>

#include <Eigen/Core>
#include <string>
#include <vector>

#include "uniphy/inference/difference_jacobian.hpp"

namespace uniphy {

struct LevenbergMarquardtOptions
    : public torch::optim::OptimizerCloneableOptions<LevenbergMarquardtOptions> {
  /// Step of the forward differences, in the unit of the leaves, which should be of order one.
  TORCH_ARG(double, difference) = 1e-6;
  /// Damping of the first step, relative to the largest squared column of the Jacobian.
  TORCH_ARG(double, damping) = 1e-2;
};

/// Nonlinear least squares as a torch::optim::Optimizer: minimises ‖r(u)‖² for few numbers u whose
/// influences differ by orders of magnitude, where a quasi-Newton method needs many evaluations to
/// learn the curvature (K. Levenberg, Quart. Appl. Math. 2, 1944; D. W. Marquardt, SIAM J. 11,
/// 1963). The Jacobian comes from forward differences, a column an evaluation. With
/// A = JᵀJ and g = Jᵀr the step solves
///   (A + λ max Aₖₖ) δ = −g
/// for several λ at once, since an evaluation is cheap beside a Jacobian. One λ for all numbers,
/// which are of order one, makes a trust region of them: it takes what is well seen and leaves what
/// is not, where a λ for each in proportion to Aᵢᵢ holds the ends of a long valley that no number
/// lies along.
///
/// A trial goes on from where its step ends as long as it pays, with the Jacobian mended by what
/// that step δ has shown: J + 2 (r(u + δ) − r(u) − J δ) δᵀ/δᵀδ, whose slope along δ is that of the
/// parabola through the step where it ends (without the 2, the slope of its chord, it is C.
/// Broyden's update, Math. Comp. 19, 1965). Along a curved valley the first step leaves it and the
/// next ones return to it. The least λ is taken whose end is lower by a quarter of what the
/// linear model says of the first step (J. Moré, 1978), else that of the lowest end; there the next
/// step looks. Where none is lower, λ grows.
///
/// A number that moves nothing (a column of zeros) stays where it is. Evaluations run side by side
/// (kernels::for_each); sums have one order, so that results have the same bits on any number of
/// threads.
class LevenbergMarquardt : public torch::optim::Optimizer {
 public:
  /// Dampings that are tried at once.
  static constexpr int kTrials = 4;
  /// Steps of a trial, at most, and evaluations of residuals that all of them take, at most.
  static constexpr int kTrialSteps = 6, kTrialEvaluations = kTrials * kTrialSteps;

  /// The leaves, float64, are moved in place.
  LevenbergMarquardt(std::vector<torch::Tensor> leaves, const LevenbergMarquardtOptions& options);

  /// One iteration on the residuals at a point, all leaves one after the other; ‖r‖² [] at the new
  /// leaves, infinite where there is none at the first ones.
  torch::Tensor step(const Residuals& residuals);
  /// Throws Error: a loss that is one number does not do.
  torch::Tensor step(LossClosure closure) override;

  /// Says that the residuals at the leaves are others from now on.
  void forget_residuals();

  /// Whether the last step found nothing lower with any damping.
  bool stuck() const { return stuck_; }
  double loss() const { return loss_; }      ///< ‖r‖² at the leaves
  double gained() const { return gained_; }  ///< by the last step
  int evaluations() const { return evaluations_; }
  torch::Tensor point() const;  ///< [N] the leaves, a copy

  /// Everything that the next steps depend on, as the bytes of a Torch archive; resume() goes on to
  /// the same bits. Throws Error where they belong to leaves of another number or are damaged.
  std::string saved() const;
  void resume(const std::string& bytes);

 private:
  struct Trial {
    torch::Tensor point, residuals;
    double loss = 0, damping = 0;
    double predicted = 0;  ///< what the linear model says that the first step gains
    int evaluations = 0;
  };

  const LevenbergMarquardtOptions& options() const;
  void move_to(const torch::Tensor& point);
  /// The lowest point of a trial; damping as a number, A = JᵀJ.
  Trial trial(const Residuals& residuals, const Eigen::MatrixXd& slopes,
              const Eigen::MatrixXd& normal, double damping) const;
  Trial best_trial(const Residuals& residuals, const Eigen::MatrixXd& J);

  torch::Tensor residuals_;  ///< [M] at the leaves; undefined: not known
  double loss_, damping_, gained_ = 0;
  int evaluations_ = 0;
  bool stuck_ = false;
};

}  // namespace uniphy
