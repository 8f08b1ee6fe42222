#pragma once

#include <string>
#include <vector>

#include "uniphy/evaluation/rollout_error.hpp"
#include "uniphy/report/experiment.hpp"
#include "uniphy/training/law_error.hpp"

namespace uniphy {

/// One held-out set and what came out for it.
struct EvaluatedSet {
  std::string name;  ///< of the split
  Dataset data;
  std::vector<TrajectorySetup> setups;
  std::vector<kernels::LawDescription> laws;  ///< with the fitted codes
  std::vector<LawError> law;
  std::vector<RolloutError> rollouts;

  std::vector<double> rollout_values() const;
  std::int64_t failed() const;
};

/// errors.csv: a line a trajectory of every set.
std::string errors_csv(const std::vector<EvaluatedSet>& sets);

/// Roll-out and stress errors of every trajectory, in the order of their size within each material:
/// `<prefix>rollout_errors.png` and `<prefix>stress_errors.png`.
void plot_errors(const EvaluatedSet& set, const std::string& prefix, const RunDirectory& out);

/// worst_rollout.png: the roll-out with the largest error that finished, the analytic one above it.
void plot_worst(const std::vector<EvaluatedSet>& sets, const RunDirectory& out);

}  // namespace uniphy
