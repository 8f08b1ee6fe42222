#pragma once

#include "uniphy/stability/planned_cell.hpp"
#include "uniphy/stability/stability_options.hpp"
#include "uniphy/stability/subjects.hpp"

namespace uniphy::stability {

/// Row `precision`: the benchmark cube on the floor in float32 and float64; drift = root of the
/// mean squared distance of the particles of one from those of the other after `steps`, over the
/// side of the cube. Holds where both do and the drift is ≤ kDriftTolerance.
Plan precision_cells(const StabilityOptions& options, const Subjects& subjects);

/// A hundredth of the body: below what grids of 20 cells a side resolve.
inline constexpr double kDriftTolerance = 1e-2;

}  // namespace uniphy::stability
