#include <torch/optim.h>

#include <random>

#include "ops/base/torch.hpp"
#include "ops/reference/law_losses.hpp"
#include "ops/reference/mlp.hpp"
#include "uniphy/bench/subjects.hpp"
#include "uniphy/data/material_ranges.hpp"
#include "uniphy/training/batches.hpp"
#include "uniphy/training/initial_model.hpp"
#include "uniphy/training/training_step.hpp"

namespace uniphy::bench {
namespace {

/// Random states of the five materials, and what their laws answer.
Dataset make_dataset(std::int64_t trajectories, std::int64_t samples) {
  Dataset data;
  std::mt19937 random(6);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit(0, 1);
  const auto& ranges = default_material_ranges();
  data.first.push_back(0);
  for (std::int64_t i = 0; i < trajectories; ++i) {
    const MaterialRanges& range = ranges[static_cast<std::size_t>(i) % ranges.size()];
    std::array<double, 5> point{};
    for (double& u : point) u = unit(random);
    const auto law = kernels::make_law<double>(material_at(range, point));
    std::vector<double> F(9 * samples), C(9 * samples), F_proj(9 * samples), tau(9 * samples);
    for (std::size_t k = 0; k < F.size(); ++k) {
      F[k] = (k % 9 % 4 == 0 ? 1 : 0) + 0.05 * normal(random);
      C[k] = normal(random);
    }
    law->evaluate(samples, 5e-4, {F.data(), 9, 1}, {C.data(), 9, 1}, {F_proj.data(), 9, 1},
                  {tau.data(), 9, 1});
    TrajectoryRecord record;
    record.material = range.name();
    data.trajectories.push_back(record);
    data.trajectory.insert(data.trajectory.end(), samples, static_cast<std::int32_t>(i));
    data.first.push_back(data.first.back() + samples);
    const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
      to.insert(to.end(), from.begin(), from.end());
    };
    append(data.samples.F, F);
    append(data.samples.F_proj, F_proj);
    append(data.samples.C, C);
    append(data.samples.tau, tau);
  }
  return data;
}

struct Training {
  Training(const Dataset& data, std::int64_t batch_size)
      : columns(law_columns(data, kernels::LawForm::isotropic)),
        sampler(columns.first, 1),
        batch(batch_size) {
    torch::Generator generator = torch::make_generator<at::CPUGeneratorImpl>(1);
    // Networks that are asked for every sample.
    options.law.state_caps = options.law.state_moduli = true;
    // A rate at which nothing moves: every step is the same work.
    options.learning_rate = 1e-9;
    model = initial_model(data, columns, options.law, generator);
    optimizer = std::make_unique<torch::optim::AdamW>(make_optimizer(model, options));
  }

  Objective objective(const ObjectiveOps& ops = {}) const { return {columns, options.loss, ops}; }
  void step(const Objective& objective) {
    training_step(objective, model, sampler.rows(0, batch), ReturnStage::actual, options,
                  *optimizer);
  }

  LawColumns columns;
  TrainingOptions options;
  BatchSampler sampler;
  std::int64_t batch;
  models::TrainedModel model;
  std::unique_ptr<torch::optim::AdamW> optimizer;
};

}  // namespace

void bench_train(const BenchOptions& options, int threads, BenchReport& report) {
  const std::int64_t batch = options.train_batch;
  Training training(make_dataset(options.train_trajectories, 2 * batch), batch);
  const Objective ours = training.objective();
  const Objective plain = training.objective(
      {&ops::reference::mlp, &ops::reference::isotropic_features, &ops::reference::law_losses});
  Measurer measurer(threads);
  measurer.add("step", [&] { training.step(ours); });
  measurer.add_baseline("step", [&] { training.step(plain); });
  measurer.run(options.effort);
  const std::int64_t samples = options.train_trajectories * batch;
  report.rows.push_back(
      make_row(measurer, "step", "train isotropic", "both", samples, static_cast<double>(samples)));
}

}  // namespace uniphy::bench
