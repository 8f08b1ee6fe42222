#pragma once

#include <string>
#include <vector>

#include "uniphy/bench/bench_options.hpp"
#include "uniphy/bench/bench_report.hpp"
#include "uniphy/report/metrics.hpp"

namespace uniphy::bench {

/// One number of metrics.json and what it should be.
struct Goal {
  std::string metric;
  std::string work;     ///< for the table
  double measured = 0;  ///< NaN where it was not measured
  double bound = 0;     ///< NaN: no goal, a fact
  bool at_most = true;  ///< else at least

  bool passes() const { return at_most ? measured <= bound : measured >= bound; }
};

/// In the order of metrics.json. Goals of subjects that were not measured are left out;
/// second_core_min and per_particle_spread are about those that were.
std::vector<Goal> goals(const BenchReport& report, const BenchOptions& options);

std::string goals_table(const std::vector<Goal>& goals);

}  // namespace uniphy::bench
