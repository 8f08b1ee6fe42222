#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "uniphy/geometry/solid.hpp"

namespace uniphy {

/// More particles than this in one body is taken for a slip of the pen.
inline constexpr std::int64_t kMaximumParticles = 10'000'000;

/// The lattice over the bounds of a solid that has `per_side` cells along the longest side. Cells
/// are as near to cubes as whole numbers along the other sides allow; particles stand at the
/// centres
/// ((i + ½)/n − ½) L + centre that are inside, the index of x slowest, that of z fastest. Throws
/// Error where no centre is inside.
std::vector<Eigen::Vector3d> fill_lattice(const Solid& solid, std::int64_t per_side);

/// The lattice whose number of particles comes nearest to `particles` (of two equally near ones the
/// coarser). A lattice cannot meet every number; the result's size says what was met.
std::vector<Eigen::Vector3d> fill_lattice_nearest(const Solid& solid, std::int64_t particles);

/// The lattice of cells at most `spacing` (m) wide.
std::vector<Eigen::Vector3d> fill_lattice_spacing(const Solid& solid, double spacing);

/// Exactly `particles` points drawn uniformly from the bounds and kept where they are inside; the
/// same on every platform for a seed. Throws Error where the solid fills less than about a 1e-5
/// part of its bounds.
std::vector<Eigen::Vector3d> fill_random(const Solid& solid, std::int64_t particles,
                                         std::uint64_t seed);

}  // namespace uniphy
