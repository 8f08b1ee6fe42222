#include "uniphy/training/latent_fit.hpp"

#include <torch/optim.h>

#include <algorithm>
#include <limits>

#include "uniphy/report/interrupt.hpp"
#include "uniphy/report/progress.hpp"
#include "uniphy/training/batches.hpp"
#include "uniphy/training/objective.hpp"
#include "uniphy/training/warm_cosine.hpp"

namespace uniphy {

using torch::Tensor;

Tensor fit_latents(const LawColumns& columns, const models::TrainedModel& model,
                   const LatentFitOptions& o) {
  const models::LearnedLaw law = model.law->frozen();
  const Tensor training_z = model.codes->z.detach();
  const Objective objective(columns, o.loss);
  const BatchSampler sampler(columns.first, o.seed);
  const std::int64_t n = sampler.trajectories(), codes = training_z.size(0);
  const std::int64_t starts = std::min(o.starts, codes);
  const auto loss_of = [&](const Tensor& z, const Tensor& rows, const Tensor& of,
                           ReturnStage stage) {
    return Objective::loss(objective.errors(law, z, rows, of), stage);
  };
  // Which training codes answer best, a code at a time against all trajectories.
  Tensor scores = torch::empty({codes, n});
  {
    torch::NoGradGuard no_grad;
    const Tensor rows = sampler.rows(-1, 64), of = torch::arange(n);
    for (std::int64_t k = 0; k < codes; ++k)
      scores[k] =
          loss_of(training_z[k].unsqueeze(0).expand({n, -1}), rows, of, ReturnStage::either);
  }
  const Tensor best = std::get<1>(scores.topk(starts, 0, /*largest=*/false));  // [starts, n]
  const Tensor initial = training_z.index_select(0, best.reshape({-1}));
  Tensor z = initial.clone().requires_grad_();
  const Tensor of = torch::arange(n).repeat({starts});
  torch::optim::Adam optimizer({z}, torch::optim::AdamOptions(o.learning_rate).betas({0.9, 0.99}));
  Progress progress("fit latents", o.steps, "steps");
  for (std::int64_t step = 0; step < o.steps; ++step) {
    throw_if_interrupted();
    static_cast<torch::optim::AdamOptions&>(optimizer.param_groups()[0].options())
        .lr(warm_cosine(o.learning_rate, step, o.steps));
    optimizer.zero_grad();
    const Tensor rows = sampler.rows(step, o.batch_per_trajectory).repeat({starts, 1});
    const Tensor prior = z.pow(2).sum() / (o.loss.latent_sigma * o.loss.latent_sigma);
    const bool last = double(step) >= kActualFrom * double(o.steps);
    const ReturnStage stage = last ? ReturnStage::actual : ReturnStage::either;
    (loss_of(z, rows, of, stage).sum() + prior * o.loss.prior_weight).backward();
    optimizer.step();
    progress.update(step + 1);
  }
  progress.finish();
  torch::NoGradGuard no_grad;
  // Some starts fail, to scales at which nothing is finite any more; the training code that
  // answers best is finite.
  const Tensor fitted = torch::cat({z.detach(), initial.narrow(0, 0, n)});
  const Tensor final_scores = loss_of(fitted, sampler.rows(-2, 256).repeat({starts + 1, 1}),
                                      torch::arange(n).repeat({starts + 1}), ReturnStage::actual)
                                  .nan_to_num(std::numeric_limits<double>::infinity());
  const Tensor winner = final_scores.view({starts + 1, n}).argmin(0);  // [n]
  return fitted.index_select(0, winner * n + torch::arange(n));
}

LatentFitOptions read_latent_fit_options(Section& config, bool with_loss) {
  Section fit = config.section("fit", "latents of the held-out trajectories");
  LatentFitOptions o;
  o.starts = fit.integer("starts", o.starts, between(1, 64), "", "training codes to try");
  o.steps = fit.integer("steps", o.steps, at_least(1), "", "optimizer steps");
  o.learning_rate = fit.real("learning_rate", o.learning_rate, Range{0, 1e3, true}, "", "of z");
  if (with_loss) read_loss_options(fit, o.loss);
  return o;
}

}  // namespace uniphy
