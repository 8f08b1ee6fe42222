
#include <algorithm>
#include <cmath>
#include <random>

#include "ops/base/torch.hpp"
#include "ops/kernels/rollout/rollout_engine.hpp"
#include "ops/reference/mpm_step.hpp"
#include "uniphy/bench/free_law.hpp"
#include "uniphy/bench/subjects.hpp"

namespace uniphy::bench {
namespace {

using kernels::ParticleState;
using torch::Tensor;

/// A cube of particles in the middle of the box, 8 a cell, jittered, in a smooth motion.
struct Body {
  kernels::GridSettings grid;
  ParticleState<float> state;
  std::vector<float> mass, volume;
};

Body make_body(std::int64_t particles) {
  Body b;
  const std::int64_t side = std::llround(std::ceil(std::cbrt(static_cast<double>(particles))));
  // Two particles along the edge of a cell; the body takes half of the box or leaves 6 nodes.
  const auto cells = static_cast<int>((side + 1) / 2);
  b.grid.n = std::max(2 * cells, cells + 12);
  b.grid.dt = 0.02 / b.grid.n / 10;  // 0.02 cells a step at 10 m/s
  const double spacing = b.grid.dx() / 2, low = 0.5 - spacing * static_cast<double>(side) / 2;
  std::mt19937 random(4);
  std::uniform_real_distribution<double> place(0.1, 0.9);
  std::vector<float> x, v;
  for (std::int64_t p = 0; p < particles; ++p) {
    const std::int64_t at[3] = {p / (side * side), p / side % side, p % side};
    double xp[3];
    for (int a = 0; a < 3; ++a) {
      xp[a] = low + spacing * (static_cast<double>(at[a]) + place(random));
      x.push_back(static_cast<float>(xp[a]));
    }
    for (int a = 0; a < 3; ++a) {
      v.push_back(static_cast<float>(1 + std::sin(6 * xp[(a + 1) % 3])));
    }
  }
  const auto V = static_cast<float>(spacing * spacing * spacing);
  b.volume.assign(particles, V);
  b.mass.assign(particles, 1000 * V);
  b.state = ParticleState<float>::undeformed(std::move(x), std::move(v));
  return b;
}

void add_plain(const Body& body, Measurer& measurer, std::vector<Tensor>& keep) {
  const auto tensor = [](const std::vector<float>& numbers, std::vector<std::int64_t> shape) {
    return torch::tensor(numbers).view(shape).requires_grad_();
  };
  const std::int64_t n = body.state.size();
  const ops::reference::MpmState state{tensor(body.state.x, {n, 3}), tensor(body.state.v, {n, 3}),
                                       tensor(body.state.C, {n, 3, 3}),
                                       tensor(body.state.F, {n, 3, 3})};
  const Tensor mass = torch::tensor(body.mass), volume = torch::tensor(body.volume);
  const ops::reference::TensorLaw law = [](const Tensor& F, const Tensor&) {
    return std::make_pair(F, FreeLaw<float>::kStiffness * (F - torch::eye(3)));
  };
  const auto step = [=] { return ops::reference::mpm_step(state, mass, volume, law, body.grid); };
  measurer.add_baseline("forward", [=] {
    const torch::NoGradGuard no_grad;
    step();
  });
  const ops::reference::MpmState next = step();
  keep = {next.x, next.v, next.C, next.F};
  std::vector<Tensor> grad;
  for (const Tensor& t : keep) grad.push_back(torch::randn(t.sizes()));
  measurer.add_baseline("backward", [&keep, grad, state] {
    torch::autograd::grad(keep, {state.x, state.v, state.C, state.F}, grad, /*retain_graph=*/true);
  });
}

void bench_size(const BenchOptions& options, std::int64_t particles, int threads,
                BenchReport& report) {
  const Body body = make_body(particles);
  const kernels::Rollout<float> rollout(
      body.grid, {{0, particles, std::make_shared<FreeLaw<float>>()}}, body.mass, body.volume);
  const std::ptrdiff_t steps = options.mpm_steps;
  // As many steps as a segment of a roll-out keeps, within two gigabytes: some 160 bytes a
  // particle-step.
  const std::ptrdiff_t kept = std::clamp<std::ptrdiff_t>(12800000 / particles, 2, steps);

  Measurer measurer(threads);
  // What a long roll-out does again and again: sort, walk the steps, hand the state over.
  kernels::RolloutEngine<float> forward_engine(rollout);
  ParticleState<float> state = body.state;
  measurer.add("forward", [&] {
    forward_engine.load(body.state);
    forward_engine.advance(0, steps);
    forward_engine.store(state);
  });
  // The adjoint of kept steps alone. A roll-out replays its steps first to have them, which the
  // epochs include.
  kernels::RolloutEngine<float> engine(rollout);
  engine.load(body.state, kept);
  engine.advance(0, kept);
  std::mt19937 random(5);
  std::normal_distribution<float> normal;
  ParticleState<float> seed = body.state;
  for (auto* numbers : {&seed.x, &seed.v, &seed.C, &seed.F}) {
    for (float& number : *numbers) number = 1e-3F * normal(random);
  }
  ParticleState<float> grad = seed;
  measurer.add("backward", [&] {
    grad = seed;
    engine.backward(grad, 0, {});
  });
  std::vector<Tensor> keep;
  const bool goal = particles == options.mpm_goal_particles;
  if (goal) add_plain(body, measurer, keep);
  measurer.run(options.effort);

  for (const char* pass : {"forward", "backward"}) {
    const bool back = pass[0] == 'b';
    const double per_call =
        static_cast<double>(particles) * static_cast<double>(back ? kept : steps);
    BenchRow row = make_row(measurer, pass, "mpm step", pass, particles, per_call);
    // One step a call in the plain version.
    row.plain *= per_call / static_cast<double>(particles);
    // 27 nodes of four numbers: multiply-adds of one scatter (2 a number) and one gather (4); twice
    // the scatter and the gathers of slopes backwards. Bytes: the state in and out, backwards the
    // kept states, the stress and the gradients too.
    row.flops = 27 * 4 * 2 * (back ? 2 + 4 + 2 * 6 : 2 + 4);
    row.bytes = 4 * (back ? 24 + 24 + 9 + 2 * 24 : 2 * 24);
    report.rows.push_back(row);
  }
}

}  // namespace

void bench_mpm(const BenchOptions& options, int threads, BenchReport& report) {
  for (const std::int64_t particles : options.mpm_particles) {
    bench_size(options, particles, threads, report);
  }
}

}  // namespace uniphy::bench
