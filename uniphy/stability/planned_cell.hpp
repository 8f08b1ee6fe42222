#pragma once

#include <functional>
#include <string>
#include <vector>

#include "uniphy/stability/stability_cell.hpp"

namespace uniphy::stability {

/// A cell that can be measured. Every call is deterministic: the same bits on any number of
/// threads.
struct PlannedCell {
  std::string stressor, method, setting;
  std::string settings;                ///< what the numbers depend on besides, as text
  std::function<void(Cell&)> measure;  ///< fills in all but the three names
};
using Plan = std::vector<PlannedCell>;

}  // namespace uniphy::stability
