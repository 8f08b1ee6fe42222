#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "uniphy/io/dataset.hpp"
#include "uniphy/report/metrics.hpp"

namespace uniphy {

/// The law errors of one trajectory, by the metric of the specification, in float64 through the
/// kernels that simulate.
struct LawError {
  double stress = 0;      ///< RMS(τ̂ − τ)/RMS(τ), both of the true projected F
  bool projects = false;  ///< whether the true law moves any F of the trajectory
  double projection = 0;  ///< RMS(F̂_proj − F_proj)/RMS(F_proj − F), or RMS(F̂_proj − F_proj) of a
                          ///< trajectory that does not project
};

/// latents: [trajectories, latent_size] row-major.
std::vector<LawError> law_errors(const Dataset& data,
                                 std::shared_ptr<const kernels::LearnedLawWeights> weights,
                                 const std::vector<double>& latents);

/// Sets `<name>.M`, the median over the trajectories of each material M, and `<name>.M.worst`.
/// values: [trajectories]; what is not finite counts as larger than everything. Only those of
/// `rows`, if given; a material without any gets no entry.
void report_errors(const Dataset& data, const std::vector<double>& values, const std::string& name,
                   Metrics& metrics, const std::vector<bool>& rows = {});

/// report_errors for `<prefix>stress_error`; for `<prefix>projection_error` over the trajectories
/// that project, which is relative, and `<prefix>unprojected_error` over the others, which is not.
void report_law_errors(const Dataset& data, const std::vector<LawError>& errors,
                       const std::string& prefix, Metrics& metrics);

}  // namespace uniphy
