
#include <algorithm>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/reference/learned_law.hpp"
#include "ops/reference/mpm_step.hpp"
#include "ops/rollout/rollout.hpp"
#include "uniphy/bench/added_memory.hpp"
#include "uniphy/bench/random_law.hpp"
#include "uniphy/bench/subjects.hpp"
#include "uniphy/inference/motion_objective.hpp"

namespace uniphy::bench {
namespace {

using torch::Tensor;

RigidMotion benchmark_motion() {
  RigidMotion motion;
  motion.centre = {0.5, 0.5, 0.5};
  motion.linear = {1, -1.5, -2};
  motion.angular = {4, 4, 4};
  return motion;
}

/// The benchmark cube (docs of configs/simulate/benchmark_cube.yaml), as an elastic body moves.
Observation observe(std::int64_t side, std::int64_t steps) {
  Observation o;
  o.particles = side * side * side;
  o.dt = 5e-4;
  const double spacing = 0.5 / static_cast<double>(side);
  o.volume.assign(o.particles, spacing * spacing * spacing);
  std::vector<double> x;
  for (std::int64_t p = 0; p < o.particles; ++p) {
    for (const std::int64_t i : {p / (side * side), p / side % side, p % side}) {
      x.push_back(0.25 + spacing * (static_cast<double>(i) + 0.5));
    }
  }
  kernels::LawDescription elastic;
  elastic.mu = 1e5;
  elastic.lambda = 2e5;
  std::vector<double> mass(o.volume);
  for (double& m : mass) m *= o.density;
  const kernels::Rollout<double> rollout(observed_grid(o, "bench"),
                                         {{0, o.particles, kernels::make_law<double>(elastic)}},
                                         mass, o.volume);
  auto state = kernels::ParticleState<double>::undeformed(x, benchmark_motion().velocities(x));
  kernels::RunOptions<double> options;
  options.every = kEpochStride;
  options.on_frame = [&o](std::ptrdiff_t step, const kernels::ParticleState<double>& at) {
    o.x.insert(o.x.end(), at.x.begin(), at.x.end());
    o.time.push_back(static_cast<double>(step) * o.dt);
    ++o.frames;
    return true;
  };
  rollout.run(state, steps, options);
  return o;
}

kernels::LawDescription description(kernels::LawForm form) {
  kernels::LawDescription law;
  law.id = kernels::LawId::learned;
  law.weights = random_law(form);
  law.z = random_code(*law.weights);
  return law;
}

Tensor initial_velocity(const Observation& o) {
  const std::vector<double> start(o.x.begin(), o.x.begin() + 3 * o.particles);
  return torch::tensor(benchmark_motion().velocities(start), torch::kFloat64).view({-1, 3});
}

/// Some steps and their gradient by z, through autograd.
Measurer::Body plain_steps(const Observation& o, const kernels::LawDescription& law,
                           std::int64_t steps) {
  const std::vector<double> start(o.x.begin(), o.x.begin() + 3 * o.particles);
  const auto tensor = [](const std::vector<double>& numbers) {
    return torch::tensor(numbers, torch::kFloat64).to(torch::kFloat32);
  };
  const Tensor x = tensor(start).view({-1, 3});
  const Tensor v = tensor(benchmark_motion().velocities(start)).view({-1, 3});
  const Tensor volume = tensor(o.volume), mass = volume * o.density;
  const auto weights = ops::to_networks(*law.weights, torch::kFloat32);
  const auto code = law.z;
  const kernels::GridSettings grid = observed_grid(o, "bench");
  return [=] {
    const Tensor z = tensor(code).requires_grad_();
    const std::int64_t n = x.size(0);
    ops::reference::MpmState state{x, v, torch::zeros({n, 3, 3}),
                                   torch::eye(3).expand({n, 3, 3}).contiguous()};
    const ops::reference::TensorLaw tensor_law = [&](const Tensor& F, const Tensor& C) {
      const Tensor F_proj = ops::reference::learned_project(weights, F, z);
      return std::make_pair(F_proj, ops::reference::learned_stress(weights, F_proj, C, z));
    };
    for (std::int64_t s = 0; s < steps; ++s) {
      state = ops::reference::mpm_step(state, mass, volume, tensor_law, grid);
    }
    torch::autograd::grad({state.x.square().mean()}, {z});
  };
}

/// An epoch on ops::rollout: the gradients of its mean squared distance from the observation, by z
/// and, with `weights`, by every number of both networks.
Measurer::Body rollout_epoch(const Observation& o, const kernels::LawDescription& law,
                             bool weights) {
  const auto tensor = [](const std::vector<double>& numbers) {
    return torch::tensor(numbers, torch::kFloat64).to(torch::kFloat32);
  };
  const std::vector<double> start(o.x.begin(), o.x.begin() + 3 * o.particles);
  const Tensor observed = tensor(o.x).view({o.frames, o.particles, 3});
  const Tensor v = tensor(benchmark_motion().velocities(start)).view({-1, 3});
  const Tensor volume = tensor(o.volume), mass = volume * o.density;
  ops::RolloutSettings settings;
  settings.grid = observed_grid(o, "bench");
  settings.steps = (o.frames - 1) * kEpochStride;
  settings.every = kEpochStride;
  ops::RolloutBody body{0, o.particles, law, tensor(law.z).requires_grad_(),
                        ops::to_networks(*law.weights, torch::kFloat32)};
  std::vector<Tensor> leaves{body.parameters};
  for (Tensor* numbers : {&body.networks.projection.numbers, &body.networks.stress.numbers}) {
    numbers->requires_grad_(weights);
    if (weights) leaves.push_back(*numbers);
  }
  return [=] {
    const Tensor x = ops::rollout(observed[0], v, {}, {}, mass, volume, {body}, settings).x;
    for (const Tensor& gradient : torch::autograd::grad({(x - observed).square().mean()}, leaves)) {
      if (!gradient.isfinite().all().item<bool>())
        throw Error("bench: a gradient of the roll-out with random weights is not finite");
    }
  };
}

/// What gradients by the weights cost beside those by z alone, in the same rounds.
void bench_weights(const Observation& o, kernels::LawForm form, const BenchOptions& options,
                   int threads, BenchReport& report) {
  const kernels::LawDescription law = description(form);
  Measurer measurer(threads);
  double added[2];
  for (const bool weights : {false, true}) {
    const Measurer::Body epoch = rollout_epoch(o, law, weights);
    apply({threads, 1});
    const AddedMemory memory;
    epoch();
    added[weights] = memory.peak_mb();
    measurer.add(weights ? "weights" : "z", epoch);
  }
  measurer.run({static_cast<int>(options.epoch_rounds), 0, 1e9});
  for (const bool weights : {false, true}) {
    const std::string name = weights ? "weights" : "z";
    BenchRow row =
        make_row(measurer, name, std::string("epoch ") + kernels::form_name(form) + " by " + name,
                 "both", o.particles, 1);
    row.memory_mb = weights ? std::max(0.0, added[1] - added[0]) : added[0];
    report.rows.push_back(row);
  }
}

}  // namespace

void bench_epoch(const BenchOptions& options, int threads, BenchReport& report) {
  const Observation observation = observe(options.epoch_side, options.epoch_steps);
  const auto objective = make_motion_objective(observation, observed_steps(observation, "bench"),
                                               observed_grid(observation, "bench"), "float32");
  const Tensor v0 = initial_velocity(observation);
  for (const auto form : {kernels::LawForm::published, kernels::LawForm::isotropic}) {
    const kernels::LawDescription law = description(form);
    // As Algorithm 2 does it: z is a leaf, the loss a tensor, the networks are those of one model.
    ops::RolloutBody body{0, observation.particles, law, torch::tensor(law.z, torch::kFloat64),
                          ops::to_networks(*law.weights, torch::kFloat64)};
    body.parameters.requires_grad_();
    const auto epoch = [&] {
      body.parameters.mutable_grad() = Tensor();
      objective->mse(body, {v0}, observation.frames).backward();
      if (!body.parameters.grad().isfinite().all().item<bool>()) {
        throw Error("bench: the gradient of an epoch with random weights is not finite");
      }
    };
    apply({threads, 1});
    const AddedMemory memory;
    epoch();
    const double added = memory.peak_mb();

    const std::int64_t plain_steps_count = std::min(options.epoch_plain_steps, options.epoch_steps);
    Measurer measurer(threads);
    measurer.add("epoch", epoch);
    measurer.run({static_cast<int>(options.epoch_rounds), 0, 1e9});
    measurer.add_baseline("epoch", plain_steps(observation, law, plain_steps_count));
    measurer.run({static_cast<int>(options.epoch_rounds), 0, 1e9});
    BenchRow row = make_row(measurer, "epoch", std::string("epoch ") + kernels::form_name(form),
                            "both", observation.particles, 1);
    row.plain *= static_cast<double>(options.epoch_steps) / static_cast<double>(plain_steps_count);
    row.memory_mb = added;
    report.rows.push_back(row);
    bench_weights(observation, form, options, threads, report);
  }
}

}  // namespace uniphy::bench
