#include "uniphy/training/trainer.hpp"

#include <ATen/CPUGeneratorImpl.h>
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <optional>

#include "ops/kernels/base/error.hpp"
#include "uniphy/report/interrupt.hpp"
#include "uniphy/report/progress.hpp"
#include "uniphy/training/batches.hpp"
#include "uniphy/training/heldout_curve.hpp"
#include "uniphy/training/initial_model.hpp"
#include "uniphy/training/training_checkpoint.hpp"
#include "uniphy/training/training_step.hpp"
#include "uniphy/training/warm_cosine.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr std::int64_t kReportEvery = 100;

void set_rate(torch::optim::Optimizer& optimizer, std::size_t group, double rate) {
  static_cast<torch::optim::AdamWOptions&>(optimizer.param_groups()[group].options()).lr(rate);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// A step with a finite loss may be the one that leads to numbers that are not: what is saved and
/// what is returned is looked at itself.
void check_finite(const TrainingResult& result, std::int64_t steps) {
  bool finite = result.model.codes->z.isfinite().all().item<bool>();
  for (const Tensor& p : result.model.law->parameters())
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
                     const std::filesystem::path& checkpoint, const LawColumns* heldout) {
  const auto start = std::chrono::steady_clock::now();
  const LawColumns columns = law_columns(data, o.law.form);
  const Objective objective(columns, o.loss);
  const BatchSampler sampler(columns.first, o.seed);
  torch::Generator generator = torch::make_generator<at::CPUGeneratorImpl>(o.seed);
  TrainingResult result;
  result.model = initial_model(data, columns, o.law, generator);
  torch::optim::AdamW optimizer = make_optimizer(result.model, o);
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
    set_rate(optimizer, 0, warm_cosine(o.learning_rate, step, o.steps));
    set_rate(optimizer, 1, warm_cosine(o.learning_rate * o.latent_rate, step, o.steps));
    const bool caps_first = double(step) < o.caps_share * double(o.steps);
    const bool last = double(step) >= kActualFrom * double(o.steps);
    const ReturnStage stage = caps_first ? ReturnStage::whole
                              : last     ? ReturnStage::actual
                                         : ReturnStage::either;
    const TrainingStep now = training_step(
        objective, result.model, sampler.rows(step, o.batch_per_trajectory), stage, o, optimizer);
    if (step % kReportEvery == 0 || step + 1 == o.steps) {
      check_finite(result, step + 1);
      result.history.push_back({step, now.loss.item<double>(), median_root(now.errors.stress),
                                median_root(now.errors.projection)});
      TrainingPoint& p = result.history.back();
      if (curve) {
        const double rate = warm_cosine(o.learning_rate * o.latent_rate, step, o.steps);
        const HeldoutErrors held_out = curve->follow(result.model.law, step, rate);
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

}  // namespace uniphy
