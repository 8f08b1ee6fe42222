#pragma once

#include <torch/torch.h>

#include <vector>

#include "uniphy/training/law_columns.hpp"
#include "uniphy/training/networks.hpp"

namespace uniphy {

/// Squared errors of a batch, [N, m] each, relative to
///   ‖τ‖² + (floor · RMS of the trajectory)²          (stress)
///   decrease² + (floor · RMS of the trajectory)²     (projection; where the trajectory's own RMS
///   is
///                                                     0, an elastic one, ‖ε‖² takes its place)
struct LawErrors {
  torch::Tensor stress;
  torch::Tensor projection;
  // Isotropic form, else undefined: the projection's error if the whole of what exceeds the cap
  // were taken off, and the share that is.
  torch::Tensor projection_whole;
  torch::Tensor share;
};

/// The differentiable errors of the learned law on samples grouped by trajectory; the loss of
/// Algorithm 1 and of a latent fit.
class Objective {
 public:
  /// Copies the columns into a tensor.
  Objective(const LawColumns& columns, kernels::LawForm form, double floor);

  /// rows: [N, m] sample indices, row i of trajectory scale_rows[i]; z: [N, latent_size].
  LawErrors errors(const Networks& networks, const torch::Tensor& z, const torch::Tensor& rows,
                   const torch::Tensor& scale_rows) const;

  /// mean log(1 + error/δ) of both kinds, a logarithm so that no trajectory drowns the others.
  static torch::Tensor robust_mean(const torch::Tensor& errors, double delta);

  /// The projection's loss of every trajectory, [N]: mean log(1 + error/δ), of the law as it is or
  /// of one that returns the whole way, whichever is less; the latter pulls the share to 1. As long
  /// as a cap is far off, a share near 0 is the easy way out, and a trap; a trajectory that returns
  /// the whole way never has to take it. `caps_first`: only the latter.
  static torch::Tensor projection_loss(const LawErrors& errors, double delta, bool caps_first);

 private:
  LawErrors isotropic(const Networks& networks, const torch::Tensor& z, const torch::Tensor& batch,
                      const torch::Tensor& scale) const;
  LawErrors seed(const Networks& networks, const torch::Tensor& z, const torch::Tensor& batch,
                 const torch::Tensor& scale) const;

  kernels::LawForm form_;
  double floor_;
  torch::Tensor columns_;  ///< [S, columns]
  torch::Tensor scales_;   ///< [N, 3]: stress, strain, decrease
};

}  // namespace uniphy
