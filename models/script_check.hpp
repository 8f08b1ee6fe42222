#pragma once

#include <cstdint>
#include <vector>

#include "models/torchscript.hpp"

namespace uniphy::models {

/// Deformations and rates that exercise a law: F = U Σ Vᵀ with random rotations, log Σ normal of
/// deviation 0.2 (singular values apart, so that the published form has one answer too), F = I
/// never; C normal of 5/s. float64, [count, 3, 3] each.
struct Probe {
  torch::Tensor F;
  torch::Tensor C;
};
Probe probe_states(std::int64_t count, std::uint64_t seed);

/// ‖script − kernels‖/‖kernels‖ over the probe, the largest over the codes. For the projection the
/// whole F_proj is compared.
struct ScriptDifference {
  double projection = 0;
  double stress = 0;
};

/// Runs the file's methods and the float64 kernels of `weights` on the same states.
ScriptDifference compare_with_kernels(const ScriptLaw& script,
                                      const kernels::LearnedLawWeights& weights,
                                      const std::vector<std::vector<double>>& codes,
                                      const Probe& probe);

}  // namespace uniphy::models
