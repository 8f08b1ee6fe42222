#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "uniphy/scene/scene.hpp"

namespace uniphy {

/// Particles in a grid cell of each body's matter, [bodies]: Δx³ · particles / volume.
std::vector<double> particles_per_cell(const PlacedScene& placed);

/// The smallest gap between the surfaces of two bodies, in cells: the distance of their nearest
/// particles less half a spacing of each (the cube root of their volume). Infinite where it is more
/// than `reach` cells. [bodies, bodies], symmetric.
std::vector<double> body_gaps(const PlacedScene& placed, double reach);

/// Of a body of less than one particle a cell of width dx (m), which falls apart as its cells
/// empty: how many there are in a cell, and the number to ask for. volume in m³.
std::optional<std::string> sparse_warning(std::int64_t particles, double volume, double dx);

/// What is physically doubtful about a scene that can run, a sentence each:
///   - a time step beyond the stable one;
///   - a body of less than one particle a cell (sparse_warning);
///   - a law at another time step than that of its training or its fit (time_step_warning), or
///     fitted to a motion that did not show the material;
///   - two bodies that do not touch and are nearer than kSharedCells: their particles move nodes of
///     the grid that both read, so that they drag each other along and stick when they part.
std::vector<std::string> scene_warnings(const SceneDescription& scene, const PlacedScene& placed);

/// Gap in cells below which two bodies share nodes: stencils are three nodes wide. Two elastic
/// cubes of 12³ particles on a grid of 32 that part at 0.5 m/s each have lost, after 0.16 s, 44,
/// 37, 27, 33, 29, 2 and 0 % of it at gaps of 0.1, 0.25, 0.5, 1, 1.5, 2 and 2.5 cells.
inline constexpr double kSharedCells = 2.5;
/// Gap in cells up to which two bodies count as touching: rounding of the placement, and less than
/// any gap that a user would give.
inline constexpr double kTouchingCells = 0.05;

}  // namespace uniphy
