#include "uniphy/training/trainer.hpp"

#include <ATen/CPUGeneratorImpl.h>
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

#include "ops/kernels/base/error.hpp"
#include "uniphy/report/interrupt.hpp"
#include "uniphy/report/progress.hpp"
#include "uniphy/training/batches.hpp"
#include "uniphy/training/heldout_curve.hpp"
#include "uniphy/training/initial_latents.hpp"
#include "uniphy/training/training_checkpoint.hpp"
#include "uniphy/training/training_step.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr std::int64_t kReportEvery = 100;
constexpr double kCapsFirst = 0.7;  ///< part of the steps, see ReturnStage

double cosine(double rate, std::int64_t step, std::int64_t steps) {
  // A short warm-up: AdamW's first steps are as large as the rate whatever the gradient.
  const double warm = std::min(1.0, double(step + 1) / 100.0);
  return warm * rate * 0.5 * (1 + std::cos(M_PI * double(step) / double(steps)));
}

void set_rate(torch::optim::Optimizer& optimizer, std::size_t group, double rate) {
  static_cast<torch::optim::AdamWOptions&>(optimizer.param_groups()[group].options()).lr(rate);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// A step with a finite loss may be the one that leads to numbers that are not: what is saved and
/// what is returned is looked at itself.
void check_finite(const TrainingResult& result, std::int64_t steps) {
  bool finite = result.z.isfinite().all().item<bool>();
  for (const Tensor& p : result.networks.parameters())
    finite = finite && p.isfinite().all().item<bool>();
  if (finite) return;
  throw Error(
      fmt::format("train: expected finite weights and codes, found others after {} steps: smaller "
                  "training.learning_rate, training.latent_rate or training.clip?",
                  steps));
}

std::string note_of(const TrainingPoint& p) {
  char note[128];
  int length = std::snprintf(note, sizeof note, "loss %.4f, stress %.2e, projection %.2e", p.loss,
                             p.stress_error, p.projection_error);
  if (std::isfinite(p.heldout_stress_error)) {
    length += std::snprintf(note + length, sizeof note - length, ", held out %.2e, %.2e",
                            p.heldout_stress_error, p.heldout_projection_error);
  }
  return {note, note + length};
}

}  // namespace

TrainingResult train(const Dataset& data, const TrainingOptions& o,
                     const std::filesystem::path& checkpoint, const Dataset* heldout) {
  const auto start = std::chrono::steady_clock::now();
  const LawColumns columns = law_columns(data, o.network.form);
  const Objective objective(columns, o.network.form, {o.error_floor, o.delta});
  const BatchSampler sampler(data, o.seed);
  torch::Generator generator = torch::make_generator<at::CPUGeneratorImpl>(o.seed);
  TrainingResult result;
  result.networks = Networks::random(o.network, generator);
  result.z = initial_latents(columns, o.network, generator);
  torch::optim::AdamW optimizer = make_optimizer(result.networks, result.z, o);
  std::optional<HeldoutCurve> curve;
  if (heldout) curve.emplace(*heldout, o);
  TrainingCheckpoint state(checkpoint, data, o, result, optimizer, curve ? &*curve : nullptr);
  std::int64_t step = state.load();
  const double before = result.seconds;
  const auto save = [&](std::int64_t at) {
    check_finite(result, at);
    result.seconds = before + seconds_since(start);
    state.save(at);
  };

  catch_interrupts();
  Progress progress("train", o.steps, "steps");
  for (; step < o.steps; ++step) {
    if (interrupt_requested()) {
      save(step);
      throw_if_interrupted();
    }
    set_rate(optimizer, 0, cosine(o.learning_rate, step, o.steps));
    set_rate(optimizer, 1, cosine(o.learning_rate * o.latent_rate, step, o.steps));
    const bool caps_first = double(step) < kCapsFirst * double(o.steps);
    const ReturnStage stage = caps_first ? ReturnStage::whole : ReturnStage::either;
    const TrainingStep now =
        training_step(objective, result.networks, result.z,
                      sampler.rows(step, o.batch_per_trajectory), stage, o, optimizer);
    if (step % kReportEvery == 0 || step + 1 == o.steps) {
      check_finite(result, step + 1);
      result.history.push_back({step, now.loss.item<double>(), median_root(now.errors.stress),
                                median_root(now.errors.projection)});
      TrainingPoint& p = result.history.back();
      if (curve) {
        const double rate = cosine(o.learning_rate * o.latent_rate, step, o.steps);
        const HeldoutErrors held_out = curve->follow(result.networks, step, rate);
        p.heldout_stress_error = held_out.stress;
        p.heldout_projection_error = held_out.projection;
      }
      progress.update(step, note_of(p));
    }
    if ((step + 1) % o.checkpoint_every == 0) save(step + 1);
  }
  progress.finish();
  result.seconds = before + seconds_since(start);
  return result;
}

Tensor fit_latents(const Dataset& data, const Networks& trained, const Tensor& training_z,
                   const LatentFitOptions& o) {
  const Networks networks = trained.frozen();
  const Objective objective(law_columns(data, networks.options.form), networks.options.form,
                            {o.error_floor, o.delta});
  const BatchSampler sampler(data, o.seed);
  const std::int64_t n = sampler.trajectories(), codes = training_z.size(0);
  const std::int64_t starts = std::min(o.starts, codes);
  const auto loss_of = [&](const Tensor& z, const Tensor& rows, const Tensor& of,
                           ReturnStage stage = ReturnStage::either) {
    return Objective::loss(objective.errors(networks, z, rows, of), stage);
  };
  // Which training codes answer best, a code at a time against all trajectories.
  Tensor scores = torch::empty({codes, n});
  {
    torch::NoGradGuard no_grad;
    const Tensor rows = sampler.rows(-1, 64), of = torch::arange(n);
    for (std::int64_t k = 0; k < codes; ++k)
      scores[k] = loss_of(training_z[k].unsqueeze(0).expand({n, -1}), rows, of);
  }
  const Tensor best = std::get<1>(scores.topk(starts, 0, /*largest=*/false));  // [starts, n]
  const Tensor initial = training_z.detach().index_select(0, best.reshape({-1}));
  Tensor z = initial.clone().requires_grad_();
  const Tensor of = torch::arange(n).repeat({starts});
  torch::optim::Adam optimizer({z}, torch::optim::AdamOptions(o.learning_rate).betas({0.9, 0.99}));
  Progress progress("fit latents", o.steps, "steps");
  for (std::int64_t step = 0; step < o.steps; ++step) {
    throw_if_interrupted();
    static_cast<torch::optim::AdamOptions&>(optimizer.param_groups()[0].options())
        .lr(cosine(o.learning_rate, step, o.steps));
    optimizer.zero_grad();
    const Tensor rows = sampler.rows(step, o.batch_per_trajectory).repeat({starts, 1});
    const Tensor prior = z.pow(2).sum() / (o.latent_sigma * o.latent_sigma);
    (loss_of(z, rows, of).sum() + prior * 1e-2).backward();
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

ModelFile model_file(const Networks& networks, const Tensor& z, const Dataset& data,
                     const std::string& config) {
  ModelFile model;
  model.weights = networks.weights();
  const Tensor codes = z.detach().to(torch::kFloat64).contiguous();
  model.latents.assign(codes.data_ptr<double>(), codes.data_ptr<double>() + codes.numel());
  for (const TrajectoryRecord& t : data.trajectories) {
    model.materials.push_back(t.material);
    model.parameters.push_back(t.parameters);
  }
  model.config = config;
  return model;
}

}  // namespace uniphy
