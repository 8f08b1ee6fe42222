#pragma once

#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::kernels {

/// The published form's Δ in units of the code's strain scale e: what a time step takes off is a
/// small part of the strain, and a network whose answers are of the order of 1 is to give it.
inline constexpr double kDeltaOverStrain = 0.02;

}  // namespace uniphy::kernels
