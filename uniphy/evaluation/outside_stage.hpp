#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// `kind: outside`: true laws that the trained one was not built around (and those it was) move the
/// benchmark cube and drawn objects; the learned law, and every wrong family, is fitted to the
/// first half of each motion and forecasts the second half (forecast.hpp).
///
/// Writes outside.md, outside.csv, forecast.png and the metrics of add_outside_metrics. Every fit
/// is kept in DIR/fits under a name that holds a hash of all that it depends on: a run that is
/// started again makes what is missing, also where laws or scenes were added, to the same result.
RunFunction outside_stage(Section& config);

}  // namespace uniphy
