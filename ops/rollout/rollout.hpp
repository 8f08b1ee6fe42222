#pragma once

#include <torch/types.h>

#include <vector>

#include "ops/kernels/rollout/rollout.hpp"
#include "ops/learned/learned_networks.hpp"

namespace uniphy::ops {

/// A body of a differentiable roll-out: the particles [begin, end) and their law.
struct RolloutBody {
  std::ptrdiff_t begin = 0, end = 0;
  kernels::LawDescription law;
  /// What the law is conditioned on and differentiated by, [N], float32 or float64: the material
  /// parameters in the order of kernels::law_parameters(law.id), or the latent z of a learned law.
  /// Replaces the numbers in `law`; undefined: those are used.
  torch::Tensor parameters;
  /// The networks of a learned law, by whose numbers the roll-out is differentiated too; they take
  /// the place of law.id and law.weights. Bodies may share them.
  LearnedNetworks networks = {};
  /// Not material but tracers (kernels::Tracer), with mass and volume 0: law, parameters and
  /// networks are not looked at. No material may come after them.
  bool tracers = false;
};

struct RolloutSettings {
  kernels::GridSettings grid;
  std::ptrdiff_t steps = 0;
  std::ptrdiff_t every = 1;  ///< frames are the states 0, every, 2 every, … ≤ steps
  bool velocities = false;
};

struct RolloutFrames {
  torch::Tensor x;  ///< [K, P, 3] m
  torch::Tensor v;  ///< [K, P, 3] m/s where asked for, else undefined
};

/// `steps` MPM steps (kernels::Rollout) as one differentiable op.
///   x0 [P, 3] m, v0 [P, 3] m/s, C0 [P, 3, 3] 1/s (undefined: zero), F0 [P, 3, 3] (undefined: I),
///   mass [P] kg, volume [P] m³ at rest, memory0 [P] of the laws that have one (undefined: zero;
///   not looked at where no law has one): all float32 or all float64, CPU
/// Differentiable, once, by x0, v0, C0, F0, memory0, the parameters of every body and the numbers
/// of its networks (where none of those wants a gradient, its price is not paid); mass and volume
/// are constants. The backward pass replays segments from checkpoints: memory grows with
/// sqrt(steps). The same bits on any number of threads. Throws Error naming the argument, what was
/// expected and what was found; or the particle that leaves the grid, with the step and the likely
/// cause.
RolloutFrames rollout(const torch::Tensor& x0, const torch::Tensor& v0, const torch::Tensor& C0,
                      const torch::Tensor& F0, const torch::Tensor& mass,
                      const torch::Tensor& volume, const std::vector<RolloutBody>& bodies,
                      const RolloutSettings& settings, const torch::Tensor& memory0 = {});

}  // namespace uniphy::ops
