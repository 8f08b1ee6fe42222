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
  /// Damping of the first step, relative to the squared columns of the Jacobian.
  TORCH_ARG(double, damping) = 1e-2;
};

/// Nonlinear least squares as a torch::optim::Optimizer: minimises ‖r(u)‖² for few numbers u whose
/// influences differ by orders of magnitude, where a quasi-Newton method needs many evaluations to
/// learn the curvature (K. Levenberg, Quart. Appl. Math. 2, 1944; D. W. Marquardt, SIAM J. 11,
/// 1963). The Jacobian comes from forward differences, a column an evaluation. With
/// A = JᵀJ and g = Jᵀr the step solves
///   (A + λ D) δ = −g,   Dᵢᵢ = max(Aᵢᵢ, 1e-6 max Aₖₖ),
/// for several λ at once, since an evaluation is cheap beside a Jacobian. The least λ is taken
/// whose end is lower by a quarter of what the linear model says (J. Moré, 1978), else that of the
/// lowest end, which alone would follow the floor of a curved valley in short steps; there the next
/// step looks. Where none is lower, λ grows.
///
/// Each step is bent by what the residuals show of their curvature a part of it ahead (geodesic
/// acceleration; M. Transtrum and J. Sethna, arXiv:1201.5885), which follows a curved valley.
///
/// A number that moves nothing (a column of zeros) stays where it is. Evaluations run side by side
/// (kernels::for_each); sums have one order, so that results have the same bits on any number of
/// threads.
class LevenbergMarquardt : public torch::optim::Optimizer {
 public:
  /// Dampings that are tried at once.
  static constexpr int kTrials = 4;
  /// Of residuals, that these take: one for the curvature and one at the end of the step each.
  static constexpr int kTrialEvaluations = 2 * kTrials;

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
  double loss() const { return loss_; }  ///< ‖r‖² at the leaves
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
    double predicted = 0;  ///< what the linear model says that the loss falls by
  };

  const LevenbergMarquardtOptions& options() const;
  void move_to(const torch::Tensor& point);
  Trial best_trial(const Residuals& residuals, const Eigen::MatrixXd& J, const Eigen::MatrixXd& A,
                   const Eigen::VectorXd& g);

  torch::Tensor residuals_;  ///< [M] at the leaves; undefined: not known
  double loss_, damping_;
  int evaluations_ = 0;
  bool stuck_ = false;
};

}  // namespace uniphy
