#pragma once

#include <torch/optim.h>

#include "ops/base/torch.hpp"
#include "uniphy/training/batches.hpp"
#include "uniphy/training/objective.hpp"
#include "uniphy/training/trainer.hpp"

namespace uniphy {

/// Medians over held-out trajectories of the root of the mean error, as in TrainingPoint.
struct HeldoutErrors {
  double stress = 0;
  double projection = 0;
};

/// The held-out side of the training curves. Every held-out trajectory has a code of its own that
/// follows the training: at each report a few steps of Adam with the networks frozen, from where
/// the last report left it. That costs a tenth of a training step each and shows overfitting while
/// it happens; the codes that count are fitted anew after training (fit_latents).
class HeldoutCurve {
 public:
  /// columns: of the held-out set, in the form of the law.
  HeldoutCurve(const LawColumns& columns, const TrainingOptions& options);

  /// Draws depend on `step` alone, so a resumed run gives the same bits. rate: of Adam.
  HeldoutErrors follow(const models::LearnedLaw& law, std::int64_t step, double rate);

  /// The state that a checkpoint keeps: [N, latent_size], and Adam's moments.
  const torch::Tensor& z() const { return z_; }
  torch::optim::Adam& optimizer() { return optimizer_; }

 private:
  const TrainingOptions options_;
  Objective objective_;
  BatchSampler sampler_;
  torch::Tensor z_;
  torch::optim::Adam optimizer_;
};

}  // namespace uniphy
