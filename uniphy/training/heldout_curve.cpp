#include "uniphy/training/heldout_curve.hpp"

#include <ATen/CPUGeneratorImpl.h>

#include "uniphy/training/initial_model.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr std::int64_t kStepsAReport = 10;
/// Apart from the training's own draws, which must not change with the held-out set.
constexpr std::uint64_t kSeedShift = 0x5851F42D4C957F2DULL;

Tensor first_codes(const LawColumns& columns, const TrainingOptions& o) {
  torch::Generator generator = torch::make_generator<at::CPUGeneratorImpl>(o.seed + kSeedShift);
  return initial_latents(columns, o.law.latent_size, generator).requires_grad_();
}

}  // namespace

HeldoutCurve::HeldoutCurve(const LawColumns& columns, const TrainingOptions& options)
    : options_(options),
      objective_(columns, options.loss),
      sampler_(columns.first, options.seed + kSeedShift),
      z_(first_codes(columns, options)),
      optimizer_({z_}, torch::optim::AdamOptions(options.learning_rate).betas({0.9, 0.99})) {}

HeldoutErrors HeldoutCurve::follow(const models::LearnedLaw& trained, std::int64_t step,
                                   double rate) {
  const models::LearnedLaw law = trained->frozen();
  const Tensor all = torch::arange(sampler_.trajectories());
  const auto errors_at = [&](std::int64_t draw) {
    return objective_.errors(
        law, z_, sampler_.rows((kStepsAReport + 1) * step + draw, options_.batch_per_trajectory),
        all);
  };
  static_cast<torch::optim::AdamOptions&>(optimizer_.param_groups()[0].options()).lr(rate);
  for (std::int64_t k = 0; k < kStepsAReport; ++k) {
    optimizer_.zero_grad();
    const LawErrors errors = errors_at(k);
    // A sum over trajectories: each code has its own loss, however many of them there are.
    const Tensor loss = errors.stress_loss.sum() + errors.projection_loss.sum();
    const Tensor prior =
        z_.pow(2).sum() / (options_.loss.latent_sigma * options_.loss.latent_sigma);
    (loss + prior * options_.loss.prior_weight).backward();
    optimizer_.step();
  }
  torch::NoGradGuard no_grad;
  const LawErrors errors = errors_at(kStepsAReport);
  return {median_root(errors.stress), median_root(errors.projection)};
}

}  // namespace uniphy
