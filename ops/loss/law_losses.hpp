#pragma once

#include <torch/types.h>

#include "ops/kernels/loss/law_losses_table.hpp"

// The loss of Algorithm 1 for the isotropic form as differentiable ops around fused kernels
// (formulas: ops/kernels/loss/law_losses_table.hpp). N trajectories, each with m samples, which
// are rows of a table of S; z [N, Z], Z ≥ 2, whose coordinates 0 and 1 carry the scales s and e
// (ops/kernels/learned/learned_law_weights.hpp). CPU, all floating-point tensors float32 or all
// float64. Same bits on any number of threads. Throws Error quoting the expected and the found
// shape or type.

namespace uniphy::ops {

/// Samples grouped by trajectory.
struct IsotropicBatch {
  torch::Tensor columns;  ///< [S, kernels::SampleColumns::count]
  torch::Tensor rows;     ///< [N, m] int64, indices into the S
};

/// What networks that answer to the state see, ahead of z; differentiable by z.
struct IsotropicFeatures {
  torch::Tensor projection;  ///< t/e, q, ℓ of the trial F: [N, m, 3]
  torch::Tensor stress;      ///< t/e, q, ℓ, tr D, d, x of the projected F: [N, m, 6]
};
IsotropicFeatures isotropic_features(const IsotropicBatch& batch, const torch::Tensor& z);

/// The networks' answers, to every sample or ([N, 1, ...]) to z alone, and those at rest, of which
/// c₂ and a₀ are taken off.
struct IsotropicAnswers {
  torch::Tensor caps;         ///< [N, m or 1, kernels::kCapOutputs]
  torch::Tensor caps_rest;    ///< [N, 1, kernels::kCapOutputs]
  torch::Tensor moduli;       ///< [N, m or 1, kernels::kStressOutputs]
  torch::Tensor moduli_rest;  ///< [N, 1, kernels::kStressOutputs]
};

/// What errors are measured by.
struct ErrorMeasure {
  double floor;  ///< errors are relative to a sample's size and this share of its trajectory's RMS
  double delta;  ///< squared relative error below which log(1 + error/δ) is linear
};

struct LawLosses {
  /// [N, kernels::kIsotropicLosses], means over the samples in the order of kernels::IsotropicMean;
  /// differentiable by the answers and by z.
  torch::Tensor losses;
  /// [N, 2], mean squared relative errors of stress and projection, for reports: no gradient.
  torch::Tensor errors;
};
/// scales: [N, 4], RMS of stress, strain and decrease of every trajectory, and kFlowStep over its
/// time step.
LawLosses law_losses(const IsotropicBatch& batch, const torch::Tensor& scales,
                     const torch::Tensor& z, const IsotropicAnswers& answers,
                     const ErrorMeasure& measure);

}  // namespace uniphy::ops
