#pragma once

#include <functional>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/mpm/g2p.hpp"
#include "ops/mpm/grid_update.hpp"
#include "ops/mpm/p2g.hpp"
#include "ops/reference/g2p.hpp"
#include "ops/reference/grid_update.hpp"
#include "ops/reference/p2g.hpp"
#include "tests/support/finite_differences.hpp"

namespace uniphy::testing {

using TensorList = std::vector<torch::Tensor>;
using TensorOp = std::function<TensorList(const TensorList&)>;

inline constexpr std::int64_t kParticles = 40;

inline kernels::GridSettings small_grid(kernels::Wall wall = kernels::Wall::freeslip) {
  kernels::GridSettings s;
  s.n = 9;  // walls and free nodes both within reach
  s.wall = wall;
  s.gravity[0] = 3;
  return s;
}

inline torch::Tensor uniform(at::IntArrayRef sizes, double low, double high,
                             torch::ScalarType type) {
  return (torch::rand(sizes, torch::kFloat64) * (high - low) + low).to(type);
}

/// x, v, C, tau, mass, volume; stresses so large that all terms of the momentum are of one size.
inline TensorList mpm_particles(torch::ScalarType type) {
  torch::manual_seed(1);
  return {
      uniform({kParticles, 3}, 0.2, 0.75, type),    uniform({kParticles, 3}, -2, 2, type),
      uniform({kParticles, 3, 3}, -20, 20, type),   uniform({kParticles, 3, 3}, -9e3, 9e3, type),
      uniform({kParticles}, 0.5, 1.5, type) * 1e-2, uniform({kParticles}, 0.5, 1.5, type) * 1e-5};
}

inline TensorList p2g_of(const TensorList& p, const kernels::GridSettings& s) {
  return {ops::p2g(p[0], p[1], p[2], p[3], p[4], p[5], s)};
}
inline TensorList p2g_reference(const TensorList& p, const kernels::GridSettings& s) {
  return {ops::reference::p2g(p[0], p[1], p[2], p[3], p[4], p[5], s)};
}
inline TensorList g2p_of(const TensorList& p, const kernels::GridSettings& s) {
  const ops::G2p r = ops::g2p(p[0], p[1], s);
  return {r.x, r.v, r.C};
}
inline TensorList g2p_reference(const TensorList& p, const kernels::GridSettings& s) {
  const ops::G2p r = ops::reference::g2p(p[0], p[1], s);
  return {r.x, r.v, r.C};
}

/// One op with its reference, at inputs that give every one of them a gradient.
struct MpmOpCase {
  const char* name;
  std::vector<const char*> names;  ///< of the inputs
  TensorOp op, reference;
  std::function<TensorList(torch::ScalarType)> inputs;
  std::vector<double> step;  ///< of central differences, for each input
};

inline std::vector<MpmOpCase> mpm_op_cases() {
  std::vector<MpmOpCase> all;
  const kernels::GridSettings s = small_grid();
  all.push_back({"p2g",
                 {"x", "v", "C", "tau", "mass", "volume"},
                 [s](const TensorList& p) { return p2g_of(p, s); },
                 [s](const TensorList& p) { return p2g_reference(p, s); },
                 [](torch::ScalarType type) { return mpm_particles(type); },
                 {1e-5, 1e-2, 1e-1, 10, 1e-5, 1e-8}});
  for (const kernels::Wall wall : {kernels::Wall::freeslip, kernels::Wall::noslip}) {
    const kernels::GridSettings w = small_grid(wall);
    all.push_back(
        {wall == kernels::Wall::freeslip ? "grid_update freeslip" : "grid_update noslip",
         {"grid"},
         [w](const TensorList& p) { return TensorList{ops::grid_update(p[0], w)}; },
         [w](const TensorList& p) { return TensorList{ops::reference::grid_update(p[0], w)}; },
         [](torch::ScalarType type) {  // a third of the nodes is empty
           torch::manual_seed(2);
           const torch::Tensor momentum = uniform({9, 9, 9, 3}, -2e-2, 2e-2, torch::kFloat64);
           const torch::Tensor mass = uniform({9, 9, 9, 1}, 0.5e-2, 1.5e-2, torch::kFloat64) *
                                      (torch::rand({9, 9, 9, 1}) > 0.3).to(torch::kFloat64);
           return TensorList{torch::cat({momentum * (mass > 0), mass}, 3).to(type)};
         },
         {1e-6}});
  }
  all.push_back({"g2p",
                 {"x", "velocity"},
                 [s](const TensorList& p) { return g2p_of(p, s); },
                 [s](const TensorList& p) { return g2p_reference(p, s); },
                 [](torch::ScalarType type) {
                   return TensorList{mpm_particles(type)[0], uniform({9, 9, 9, 3}, -2, 2, type)};
                 },
                 {1e-5, 1e-2}});
  return all;
}

/// A fixed random linear functional of all results, each weighted by the size that it has in
/// `like`.
inline torch::Tensor mpm_loss(const TensorList& results, const TensorList& like) {
  torch::manual_seed(7);
  torch::Tensor sum = torch::zeros({}, torch::kFloat64);
  for (std::size_t i = 0; i < results.size(); ++i) {
    const torch::Tensor weight = torch::randn(results[i].sizes(), torch::kFloat64);
    sum = sum + (weight.to(results[i].scalar_type()) * results[i]).sum() /
                    like[i].abs().max().item<double>();
  }
  return sum;
}

inline TensorList mpm_gradients(const TensorOp& op, const TensorList& inputs) {
  TensorList leaves;
  for (const torch::Tensor& t : inputs) leaves.push_back(t.detach().clone().requires_grad_());
  const TensorList results = op(leaves);
  return torch::autograd::grad({mpm_loss(results, results)}, leaves);
}

/// Relative error of the gradient by input i against central differences, float64, over the twenty
/// coordinates with the largest gradients.
inline double mpm_gradient_error(const MpmOpCase& c, std::size_t i) {
  const TensorList inputs = c.inputs(torch::kFloat64), like = c.op(inputs);
  const torch::Tensor flat = mpm_gradients(c.op, inputs)[i].flatten();
  const torch::Tensor picked = std::get<1>(flat.abs().topk(20));
  std::vector<double> found, expected;
  for (int q = 0; q < 20; ++q) {
    const std::int64_t k = picked[q].item<std::int64_t>();
    const auto value = [&](const std::vector<double>& t) {
      TensorList moved = inputs;
      moved[i] = inputs[i].clone();
      moved[i].view({-1})[k] += t[0];
      return mpm_loss(c.op(moved), like).item<double>();
    };
    found.push_back(flat[k].item<double>());
    expected.push_back(central_differences(value, {0}, {c.step[i]})[0]);
  }
  return relative_error(found, expected);
}

}  // namespace uniphy::testing
