#pragma once

#include "models/learned_law.hpp"
#include "ops/base/torch.hpp"
#include "ops/loss/law_losses.hpp"
#include "uniphy/training/law_columns.hpp"
#include "uniphy/training/loss_options.hpp"

namespace uniphy {

/// The errors of a batch, each [N], means over the samples of a trajectory. A squared error is
/// relative to
///   ‖τ‖² + (floor · RMS of the trajectory)²          (stress)
///   decrease² + (floor · RMS of the trajectory)²     (projection; where the trajectory's own RMS
///                                                     is 0, an elastic one, ‖ε‖² takes its place)
/// and enters the loss as log(1 + error/δ), so that no trajectory drowns the others; or, where the
/// loss is `squared`, the squared errors do over the squared RMS alone.
struct LawErrors {
  torch::Tensor stress_loss;
  torch::Tensor projection_loss;
  // Isotropic form, else undefined: the projection's loss if the whole of what exceeds the cap were
  // taken off, and the share that is (formulas: ops/kernels/loss/law_losses_table.hpp).
  torch::Tensor whole_loss;
  torch::Tensor share;
  torch::Tensor power;  ///< p̃², of the power of the excess that the rate of flow goes with
  // The squared errors themselves, for reports: they have no gradient.
  torch::Tensor stress;
  torch::Tensor projection;
};

/// Which projection is judged: that of the law as it is, its share pulled to 1 if it is close to it
/// (`actual`), of one that returns the whole
/// way to its caps and has its share pulled to 1 (`whole`), or whichever is less (`either`). As
/// long as a cap is far off, a share near 0 is the easy way out, and a trap; so a training looks at
/// the caps alone first, and then lets each trajectory have a share of its own where that is
/// better.
enum class ReturnStage { whole, either, actual };

/// From this part of the steps on, of a training or a fit of codes, the law is judged as it is, for
/// those that return the whole way, too: what is left of their share is worth more than the pull of
/// `either` says.
inline constexpr double kActualFrom = 0.9;

/// What an objective evaluates: the fused ops. Plain tensor operations may take their place, to be
/// compared with (uniphy/bench).
struct ObjectiveOps {
  torch::Tensor (*mlp)(const torch::Tensor& features, const torch::Tensor& z,
                       const ops::FlatLayers& layers, kernels::Activation activation) = &ops::mlp;
  decltype(&ops::isotropic_features) isotropic_features = &ops::isotropic_features;
  decltype(&ops::law_losses) law_losses = &ops::law_losses;
};

/// The differentiable errors of the learned law on samples grouped by trajectory; the loss of
/// Algorithm 1 and of a latent fit.
class Objective {
 public:
  /// Shares the columns.
  Objective(const LawColumns& columns, const LossOptions& loss, const ObjectiveOps& ops = {});

  /// rows: [N, m] sample indices, row i of trajectory scale_rows[i]; z: [N, latent_size]. The law
  /// has the form of the columns.
  LawErrors errors(const models::LearnedLaw& law, const torch::Tensor& z, const torch::Tensor& rows,
                   const torch::Tensor& scale_rows) const;

  /// The loss of every trajectory, [N]: that of the stress, and that of the projection.
  static torch::Tensor loss(const LawErrors& errors, ReturnStage stage);

 private:
  LawErrors isotropic(const models::LearnedLaw& law, const torch::Tensor& z,
                      const torch::Tensor& rows, const torch::Tensor& scale) const;
  LawErrors published(const models::LearnedLaw& law, const torch::Tensor& z,
                      const torch::Tensor& rows, const torch::Tensor& scale) const;

  kernels::LawForm form_;
  ops::ErrorMeasure measure_;
  bool squared_;
  ObjectiveOps ops_;
  torch::Tensor columns_;  ///< [S, columns]
  torch::Tensor scales_;   ///< [N, 4]: stress, strain, decrease, flow_time
};

/// Of a report: the median over trajectories of the root of squared errors, [N].
double median_root(const torch::Tensor& errors);

}  // namespace uniphy
