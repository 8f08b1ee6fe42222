#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ops/kernels/learned_law_weights.hpp"
#include "uniphy/io/dataset.hpp"
#include "uniphy/report/metrics.hpp"

namespace uniphy {

/// The law errors of one trajectory, by the metric of the specification, in float64 through the
/// kernels that simulate.
struct LawError {
  double stress = 0;  ///< RMS(τ̂ − τ)/RMS(τ), both of the true projected F
  double projection = 0;  ///< RMS(F̂_proj − F_proj)/RMS(F_proj − F); where the law projects nothing,
                          ///< RMS(F̂_proj − F_proj)
};

/// latents: [trajectories, latent_size] row-major.
std::vector<LawError> law_errors(const Dataset& data,
                                 std::shared_ptr<const kernels::LearnedLawWeights> weights,
                                 const std::vector<double>& latents);

/// Sets `<prefix>stress_error.M`, `<prefix>projection_error.M` (medians over the trajectories of
/// each material M) and the same with `.worst`.
void report_law_errors(const Dataset& data, const std::vector<LawError>& errors,
                       const std::string& prefix, Metrics& metrics);

}  // namespace uniphy
