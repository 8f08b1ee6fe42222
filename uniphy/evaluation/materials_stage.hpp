#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// Stage of uniphy_evaluate, `kind: materials`: what held-out objects are made of, read off their
/// motion alone. Objects are drawn as those of the held-out sets (new parameters over the whole
/// ranges, shapes and motions that training never saw), thrown at a wall and observed closed or as
/// a laboratory sees them; the reading is held against that of the true law, and the 90 % intervals
/// against the truth. Writes materials.md, materials.csv and, as fits end, DIR/fits; an interrupted
/// run goes on where it was.
///
/// Metrics: those of add_materials_metrics; fits, fits_failed, seconds_a_fit (median).
RunFunction materials_stage(Section& config);

}  // namespace uniphy
