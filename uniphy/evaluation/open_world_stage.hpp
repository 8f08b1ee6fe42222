#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// `kind: open_world`: motions by the five families are observed as a laboratory would see them
/// (open_world_cases.hpp); the learned law is fitted to the first half of each and forecasts where
/// all particles are in the second half.
///
/// Writes open_world.md, open_world.csv and, medians over scenes, forecast.CASE.MATERIAL,
/// floor.CASE.MATERIAL, fit.CASE.MATERIAL, explained.CASE.MATERIAL, named_right.CASE.MATERIAL
/// (share of scenes whose fitted law behaves like the material, MaterialReading),
/// fit_s.CASE.MATERIAL, fit_rollouts.CASE.MATERIAL; fits. Finished fits are kept as in
/// outside_stage().
RunFunction open_world_stage(Section& config);

}  // namespace uniphy
