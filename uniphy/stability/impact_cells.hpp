#pragma once

#include "uniphy/stability/planned_cell.hpp"
#include "uniphy/stability/stability_options.hpp"
#include "uniphy/stability/subjects.hpp"

namespace uniphy::stability {

/// Bodies in the middle of the ranges of every family, at `auto`:
///   impact_wall    thrown at a wall at 1, 5, 20, 50 m/s
///   impact_corner  into a corner, the same speeds
///   collision      two bodies head on, 1 … 50 m/s towards each other. Momentum is kept: the drift
///                  of the total one, over what one body had, ≤ kMomentumTolerance
///   pushed         pulled sideways at a wall with 10, 100, 1000 m/s²
///   soft_impact    an elastic body of the lower ends of its ranges (μ 350 Pa, λ 500 Pa), thrown at
///                  the wall at 1, 5, 20, 50 m/s: up to 45 times the speed of its own sound
///   light_body     free flight at mass densities of 1000, 10, 1 and 0.1 kg/m³, elastic; momentum
///                  as above
Plan impact_cells(const StabilityOptions& options, const Subjects& subjects);

/// A transfer in float64 keeps momentum to rounding; what a grid with m + ε loses is above this.
inline constexpr double kMomentumTolerance = 1e-6;

}  // namespace uniphy::stability
