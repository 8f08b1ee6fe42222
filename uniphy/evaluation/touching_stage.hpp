#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// `kind: touching`: for each of the five families a cube of it lies below one of the next family,
/// which falls on it. What is seen of both is as in open_world_cases.hpp; a code for each is fitted
/// to the first half (infer_bodies) and forecasts where all their particles are in the second.
///
/// Writes touching.md, touching.csv and, CASE.LOWER.UPPER with `lower` or `upper` behind it,
/// forecast., fit., named_right.; fit_s.CASE.LOWER.UPPER. Finished pairs are kept in DIR/fits.
RunFunction touching_stage(Section& config);

}  // namespace uniphy
