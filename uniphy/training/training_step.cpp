#include "uniphy/training/training_step.hpp"

namespace uniphy {

using torch::Tensor;

torch::optim::AdamW make_optimizer(const models::TrainedModel& model, const TrainingOptions& o) {
  const auto options = [](double rate, double decay) {
    return std::make_unique<torch::optim::AdamWOptions>(
        torch::optim::AdamWOptions(rate).weight_decay(decay).betas({0.9, 0.99}));
  };
  std::vector<torch::optim::OptimizerParamGroup> groups;
  groups.emplace_back(model.law->parameters(), options(o.learning_rate, o.weight_decay));
  groups.emplace_back(model.codes->parameters(), options(o.learning_rate * o.latent_rate, 0.0));
  return torch::optim::AdamW(groups);
}

TrainingStep training_step(const Objective& objective, const models::TrainedModel& model,
                           const Tensor& rows, ReturnStage stage, const TrainingOptions& o,
                           torch::optim::AdamW& optimizer) {
  const Tensor& z = model.codes->z;
  optimizer.zero_grad();
  TrainingStep step;
  step.errors = objective.errors(model.law, z, rows, torch::arange(z.size(0)));
  const Tensor prior = z.pow(2).sum(1).mean() / (o.loss.latent_sigma * o.loss.latent_sigma);
  step.loss = Objective::loss(step.errors, stage).mean() + prior * o.loss.prior_weight;
  step.loss.backward();
  if (o.clip_each) {
    for (const Tensor& network : model.law->parameters())
      torch::nn::utils::clip_grad_norm_(network, o.clip);
  } else {
    torch::nn::utils::clip_grad_norm_(model.law->parameters(), o.clip);
  }
  optimizer.step();
  return step;
}

}  // namespace uniphy
