#pragma once

#include <string>
#include <vector>

#include "uniphy/evaluation/ablation_options.hpp"
#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// A finished variant and its metrics (ablation_stage.hpp, without the leading name).
struct AblationRow {
  AblationVariant variant;
  Metrics metrics;
};

/// ablation.md: one table over all materials, ordered as the variants are, and one for each kind of
/// error by material.
std::string ablation_table(const std::vector<AblationRow>& rows,
                           const std::vector<std::string>& materials);

/// ablation.csv: a line a variant, a column a metric.
std::string ablation_csv(const std::vector<AblationRow>& rows);

/// rollout_against_cost.png and stress_against_cost.png: median error against ns a particle-step.
void plot_against_cost(const std::vector<AblationRow>& rows, const RunDirectory& out);

}  // namespace uniphy
