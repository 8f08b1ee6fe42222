#include "models/script_check.hpp"

#include <ATen/CPUGeneratorImpl.h>

#include <algorithm>
#include <memory>

#include "ops/base/torch.hpp"
#include "ops/learned/learned_law.hpp"

namespace uniphy::models {

using torch::Tensor;

namespace {

double relative(const Tensor& a, const Tensor& b) {
  const double scale = b.norm().item<double>();
  const double difference = (a.to(torch::kFloat64) - b).norm().item<double>();
  return scale > 0 ? difference / scale : difference;
}

/// Rotations from random quaternions.
Tensor rotations(std::int64_t count, torch::Generator& generator) {
  const Tensor q = torch::empty({count, 4}, torch::kFloat64).normal_(0, 1, generator);
  const auto c = (q / q.norm(2, 1, true)).unbind(1);
  const Tensor w = c[0], x = c[1], y = c[2], z = c[3];
  return torch::stack({1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                       2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                       2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
                      1)
      .reshape({count, 3, 3});
}

}  // namespace

Probe probe_states(std::int64_t count, std::uint64_t seed) {
  torch::Generator generator = at::make_generator<at::CPUGeneratorImpl>(seed);
  const Tensor strain = torch::empty({count, 3}, torch::kFloat64).normal_(0, 0.2, generator);
  // At least 0.02 apart.
  const Tensor apart = torch::tensor({0.02, 0.0, -0.02}, torch::kFloat64);
  const Tensor sigma = std::get<0>(strain.sort(1, /*descending=*/true)).add(apart).exp();
  const Tensor U = rotations(count, generator), V = rotations(count, generator);
  return {U.matmul(torch::diag_embed(sigma)).matmul(V.mT()),
          torch::empty({count, 3, 3}, torch::kFloat64).normal_(0, 5, generator)};
}

ScriptDifference compare_with_kernels(const ScriptLaw& script,
                                      const kernels::LearnedLawWeights& weights,
                                      const std::vector<std::vector<double>>& codes,
                                      const Probe& probe) {
  const ops::LearnedNetworks networks = ops::to_networks(weights, torch::kFloat64);
  ScriptDifference largest;
  for (const auto& code : codes) {
    const Tensor z = torch::tensor(code, torch::kFloat64);
    const ops::LawOutput expected = ops::learned_law(networks, probe.F, probe.C, z);
    const Tensor F_proj = script.project(probe.F, z);
    const Tensor tau = script.stress(expected.F_proj, probe.C, z);
    // std::max would drop a NaN.
    const double projection = relative(F_proj, expected.F_proj);
    const double stress = relative(tau, expected.tau);
    if (!(projection <= largest.projection)) largest.projection = projection;
    if (!(stress <= largest.stress)) largest.stress = stress;
  }
  return largest;
}

}  // namespace uniphy::models
