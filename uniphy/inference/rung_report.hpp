#pragma once

#include <string>
#include <vector>

#include "uniphy/inference/adapted_variables.hpp"

namespace uniphy {

/// What a rung came to.
struct RungReport {
  Rung rung = Rung::latent;
  /// Root of the mean square error over size, on the frames that were fitted and on those kept;
  /// infinite where the roll-out fails.
  double fitted = 0, kept = 0;
  int roll_outs = 0;
  double seconds = 0;  ///< of the runs that finished its steps
};

/// The rungs as a table, a line each; empty where there are none.
std::string rung_table(Rung chosen, const std::vector<RungReport>& rungs);

}  // namespace uniphy
