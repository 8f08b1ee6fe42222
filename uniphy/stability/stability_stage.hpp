#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy::stability {

/// Declares the keys of uniphy_stability (stability_options.hpp) and returns its work: every
/// stressor by every method, resumed from the cells that DIR/cells has, and the tables.
RunFunction stability_stage(Section& config);

}  // namespace uniphy::stability
