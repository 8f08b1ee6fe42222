#include "uniphy/training/training_step.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// Of ‖z‖²/σ² beside the errors.
constexpr double kPriorWeight = 1e-2;

}  // namespace

torch::optim::AdamW make_optimizer(const Networks& networks, const Tensor& z,
                                   const TrainingOptions& o) {
  const auto options = [](double rate, double decay) {
    return std::make_unique<torch::optim::AdamWOptions>(
        torch::optim::AdamWOptions(rate).weight_decay(decay).betas({0.9, 0.99}));
  };
  std::vector<torch::optim::OptimizerParamGroup> groups;
  groups.emplace_back(networks.parameters(), options(o.learning_rate, o.weight_decay));
  groups.emplace_back(std::vector<Tensor>{z}, options(o.learning_rate * o.latent_rate, 0.0));
  return torch::optim::AdamW(groups);
}

TrainingStep training_step(const Objective& objective, const Networks& networks, const Tensor& z,
                           const Tensor& rows, ReturnStage stage, const TrainingOptions& o,
                           torch::optim::AdamW& optimizer) {
  optimizer.zero_grad();
  TrainingStep step;
  step.errors = objective.errors(networks, z, rows, torch::arange(z.size(0)));
  const Tensor prior = z.pow(2).sum(1).mean() / (o.latent_sigma * o.latent_sigma);
  step.loss = Objective::loss(step.errors, stage).mean() + prior * kPriorWeight;
  step.loss.backward();
  torch::nn::utils::clip_grad_norm_(networks.parameters(), o.clip);
  optimizer.step();
  return step;
}

}  // namespace uniphy
