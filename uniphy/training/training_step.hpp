#pragma once

#include <torch/optim.h>

#include "ops/base/torch.hpp"
#include "uniphy/training/objective.hpp"
#include "uniphy/training/trainer.hpp"

namespace uniphy {

/// AdamW on the weights (group 0) and on the codes z (group 1, without decay).
torch::optim::AdamW make_optimizer(const models::TrainedModel& model,
                                   const TrainingOptions& options);

struct TrainingStep {
  torch::Tensor loss;  ///< before the step
  LawErrors errors;
};
/// One step of Algorithm 1 on the samples `rows` [N, m] of all trajectories: the loss, its
/// gradient, and the optimizer's step.
TrainingStep training_step(const Objective& objective, const models::TrainedModel& model,
                           const torch::Tensor& rows, ReturnStage stage,
                           const TrainingOptions& options, torch::optim::AdamW& optimizer);

}  // namespace uniphy
