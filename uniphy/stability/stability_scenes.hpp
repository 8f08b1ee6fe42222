#pragma once

#include <cstdint>

#include "uniphy/scene/scene.hpp"

namespace uniphy::stability {

/// per_side: particles along 0.5 m of a body; 10 are one a cell.

/// The benchmark cube of the field (NCLaw: side 0.5 m, v = (1, −1.5, −2) m/s, 4 rad/s about each
/// axis, n = 20), set on the floor, so that it is hit in the first step however short the step is;
/// or a smaller one.
SceneDescription cube_on_floor(const kernels::LawDescription& law, std::int64_t per_side,
                               std::int64_t steps, double size = 0.5);

/// A cube of 0.3 m, a cell away from the wall, thrown at it along y, without gravity.
SceneDescription thrown_at_wall(const kernels::LawDescription& law, double speed,
                                std::int64_t per_side, std::int64_t steps);
/// The same into a corner, along the diagonal.
SceneDescription thrown_into_corner(const kernels::LawDescription& law, double speed,
                                    std::int64_t per_side, std::int64_t steps);
/// Two cubes of 0.2 m that meet head on in the middle, each at half of the speed.
SceneDescription two_cubes(const kernels::LawDescription& law, double speed, std::int64_t per_side,
                           std::int64_t steps);
/// A cube of 0.3 m at a wall under a steady sideways pull (m/s²) that presses it against it.
SceneDescription pushed_at_wall(const kernels::LawDescription& law, double pull,
                                std::int64_t per_side, std::int64_t steps);
/// A cube of 0.3 m of a mass density (kg/m³) flying freely, no wall within reach for 0.2 s.
SceneDescription free_flight(const kernels::LawDescription& law, double density,
                             std::int64_t per_side, std::int64_t steps);

}  // namespace uniphy::stability
