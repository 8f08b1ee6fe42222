#pragma once

#include "uniphy/stability/planned_cell.hpp"
#include "uniphy/stability/stability_options.hpp"
#include "uniphy/stability/subjects.hpp"

namespace uniphy::stability {

/// Row `horizons`: a cube of 0.3 m and 6³ particles on the floor, elastic, plasticine and sand, in
/// float64 and float32. L = Σ w·x of the last state over P, w uniform in [−1, 1]; dL/d(log of the
/// first parameter), of the isotropic law dL/dz₀, by the adjoint of the roll-out, against central
/// quotients in float64 with steps of 1e-4 and 1e-5 of it.
/// adjoint_growth = ‖dL/dx₀‖/‖dL/dx_N‖. Where the quotients disagree by more than kChaos with each
/// other, or with the adjoint, a third one with a step of 1e-8 is asked:
///   local = 1   it agrees with the adjoint: that is the derivative, but the motion bends within
///   1e-5
///               of the parameter (undeformed particles at the tip of a yield surface, or chaos)
///   chaos = 1   it does not agree, nor do the other two with each other: no derivative is of use
///               there, whoever computes it
/// Such cells hold where their numbers are finite. Two quotients that agree with each other and not
/// with the adjoint, and no third one that does, are an error of the gradient, which fails.
Plan horizon_cells(const StabilityOptions& options, const Subjects& subjects);

inline constexpr double kChaos = 1e-2;
/// Relative; larger errors turn a fit. Measured: 1e-9 … 4e-5 and 2e-6 … 7e-2 at 2000 steps.
inline constexpr double kLongTolerance64 = 1e-3, kLongTolerance32 = 0.1;

}  // namespace uniphy::stability
