#include "uniphy/training/law_error.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "ops/kernels/base/statistics.hpp"
#include "ops/kernels/laws/law.hpp"

namespace uniphy {
std::vector<LawError> law_errors(const Dataset& data,
                                 std::shared_ptr<const kernels::LearnedLawWeights> weights,
                                 const std::vector<double>& latents) {
  const std::int64_t n = std::int64_t(data.trajectories.size());
  const std::int64_t size = weights->latent_size;
  // The stress is asked at the true projected F, so that one error does not count twice.
  const auto projection_only = kernels::without_stress(*weights);
  const auto stress_only = kernels::without_projection(*weights);
  std::vector<LawError> errors(std::size_t(n), LawError{});
  for (std::int64_t i = 0; i < n; ++i) {
    kernels::LawDescription description;
    description.id = kernels::LawId::learned;
    description.weights = projection_only;
    description.z.assign(latents.begin() + i * size, latents.begin() + (i + 1) * size);
    const auto law = kernels::make_law<double>(description);
    const std::int64_t count = data.first[i + 1] - data.first[i];
    if (count == 0) continue;
    const double* F = data.samples.F.data() + 9 * data.first[i];
    const double* F_proj = data.samples.F_proj.data() + 9 * data.first[i];
    const double* C = data.samples.C.data() + 9 * data.first[i];
    const double* tau = data.samples.tau.data() + 9 * data.first[i];
    std::vector<double> projected(std::size_t(9 * count)), stress(projected.size()),
        unused(projected.size());
    const double dt = data.trajectories[i].dt;
    law->evaluate(count, dt, {F, 9, 1}, {C, 9, 1}, {projected.data(), 9, 1}, {unused.data(), 9, 1});
    description.weights = stress_only;
    kernels::make_law<double>(description)
        ->evaluate(count, dt, {F_proj, 9, 1}, {C, 9, 1}, {unused.data(), 9, 1},
                   {stress.data(), 9, 1});
    const double of_stress = kernels::squared_distance(stress.data(), tau, 9 * count);
    const double stress_size = kernels::sum_of_squares(tau, 9 * count);
    const double of_projection = kernels::squared_distance(projected.data(), F_proj, 9 * count);
    const double change = kernels::squared_distance(F_proj, F, 9 * count);
    errors[i].stress = std::sqrt(of_stress / std::max(stress_size, 1e-300));
    errors[i].projects = change > 0;
    errors[i].projection = change > 0 ? std::sqrt(of_projection / change)
                                      : std::sqrt(of_projection / double(9 * count));
  }
  return errors;
}

void report_errors(const Dataset& data, const std::vector<double>& values, const std::string& name,
                   Metrics& metrics, const std::vector<bool>& rows) {
  std::map<std::string, std::vector<double>> of;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!rows.empty() && !rows[i]) continue;
    // A NaN has no place in an order.
    of[data.trajectories[i].material].push_back(
        std::isfinite(values[i]) ? values[i] : std::numeric_limits<double>::infinity());
  }
  for (const auto& [material, list] : of) {
    metrics.set(name + "." + material, kernels::median(list));
    metrics.set(name + "." + material + ".worst", *std::max_element(list.begin(), list.end()));
  }
}

void report_law_errors(const Dataset& data, const std::vector<LawError>& errors,
                       const std::string& prefix, Metrics& metrics) {
  std::vector<double> stress, projection;
  std::vector<bool> projects, others;
  for (const LawError& e : errors) {
    stress.push_back(e.stress);
    projection.push_back(e.projection);
    projects.push_back(e.projects);
    others.push_back(!e.projects);
  }
  report_errors(data, stress, prefix + "stress_error", metrics);
  report_errors(data, projection, prefix + "projection_error", metrics, projects);
  report_errors(data, projection, prefix + "unprojected_error", metrics, others);
}

}  // namespace uniphy
