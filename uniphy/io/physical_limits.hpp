#pragma once

namespace uniphy {

// Beyond these a number is a slip of the pen or a damaged file, and what follows from it blames
// something else: a time step, a placement, a learning rate.

/// kg/m³. Aerogels have 0.16, osmium 22 590, the core of the sun 150 000.
inline constexpr double kLeastDensity = 1e-3, kLargestDensity = 1e6;
/// s. Waves at 10 km/s, those of diamond, pass a cell of 1/1024 m in 1e-7.
inline constexpr double kLeastTimeStep = 1e-9;
/// m/s², each coordinate. An ultracentrifuge has 1e7.
inline constexpr double kLargestGravity = 1e7;

/// Latent codes and weights, without units: the model of models/pretrained has 24 and 27 at most.
inline constexpr double kLargestCode = 1e6, kLargestWeight = 1e6;

}  // namespace uniphy
