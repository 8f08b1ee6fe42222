// What Python has to find to the bit: the loss of a roll-out of a trained law against an
// observation and its gradient, from the same op in C++.
//   uniphy_rollout_gradient MODEL OBSERVATION CODE float32|float64 EPOCHS
// Prints the loss and the gradients by z and by the numbers of the networks, hexadecimal, then,
// where EPOCHS > 0, the seconds of the fastest of so many epochs of Algorithm 2 (roll-out, loss,
// gradient by z, step of Adam).

#include <torch/torch.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <string>
#include <vector>

#include "ops/kernels/base/error.hpp"
#include "ops/rollout/rollout.hpp"
#include "uniphy/io/model_file.hpp"
#include "uniphy/io/observation.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

void print(const char* name, const Tensor& numbers) {
  const Tensor flat = numbers.detach().to(torch::kFloat64).flatten().contiguous();
  std::printf("%s", name);
  for (std::int64_t k = 0; k < flat.numel(); ++k) std::printf(" %a", flat[k].item<double>());
  std::printf("\n");
}

/// A roll-out that follows an observation.
struct Problem {
  Tensor seen, v0, mass, volume, z;
  ops::LearnedNetworks networks;
  ops::RolloutSettings settings;

  Problem(const ModelFile& model, const Observation& o, std::int64_t code, torch::Dtype dtype) {
    const double interval = o.time[1] - o.time[0];
    settings.every = std::lround(interval / o.dt);
    settings.steps = settings.every * (o.frames - 1);
    settings.grid.n = o.grid;
    settings.grid.dt = o.dt;
    std::copy(o.gravity.begin(), o.gravity.end(), settings.grid.gravity);
    settings.grid.wall = o.walls == "noslip" ? kernels::Wall::noslip : kernels::Wall::freeslip;
    settings.grid.bound = o.bound;
    const Tensor x = torch::tensor(o.x, torch::kFloat64).view({o.frames, o.particles, 3});
    const Tensor V = torch::tensor(o.volume, torch::kFloat64);
    seen = x.to(dtype);
    v0 = ((x[1] - x[0]) / (double(settings.every) * o.dt)).to(dtype);
    mass = (o.density * V).to(dtype);
    volume = V.to(dtype);
    z = torch::tensor(model.code(code), torch::kFloat64).to(dtype).requires_grad_();
    networks = ops::to_networks(model.weights, dtype);
  }

  Tensor loss() const {
    ops::RolloutBody body;
    body.end = seen.size(1);
    body.parameters = z;
    body.networks = networks;
    const Tensor x = ops::rollout(seen[0], v0, {}, {}, mass, volume, {body}, settings).x;
    return torch::mse_loss(x, seen);
  }
};

double fastest_epoch(const Problem& problem, int epochs) {
  torch::optim::Adam optimizer({problem.z}, torch::optim::AdamOptions(1e-3));
  double fastest = std::numeric_limits<double>::infinity();
  for (int epoch = 0; epoch < epochs; ++epoch) {
    const auto start = std::chrono::steady_clock::now();
    optimizer.zero_grad();
    problem.loss().backward();
    optimizer.step();
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
    fastest = std::min(fastest, time.count());
  }
  return fastest;
}

}  // namespace
}  // namespace uniphy

int main(int argc, char** argv) {
  try {
    if (argc != 6) throw uniphy::Error("expected MODEL OBSERVATION CODE DTYPE EPOCHS");
    const auto dtype = std::string(argv[4]) == "float64" ? torch::kFloat64 : torch::kFloat32;
    uniphy::Problem problem(uniphy::read_model(argv[1]), uniphy::read_observation(argv[2]),
                            std::stol(argv[3]), dtype);
    torch::Tensor& projection = problem.networks.projection.numbers;
    torch::Tensor& stress = problem.networks.stress.numbers;
    projection.requires_grad_();
    stress.requires_grad_();
    const torch::Tensor loss = problem.loss();
    loss.backward();
    uniphy::print("loss", loss);
    uniphy::print("z", problem.z.grad());
    uniphy::print("projection", projection.grad());
    uniphy::print("stress", stress.grad());
    projection.requires_grad_(false);
    stress.requires_grad_(false);
    const int epochs = std::stoi(argv[5]);
    if (epochs > 0) std::printf("seconds %.6g\n", uniphy::fastest_epoch(problem, epochs));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "uniphy_rollout_gradient: %s\n", error.what());
    return 1;
  }
}
