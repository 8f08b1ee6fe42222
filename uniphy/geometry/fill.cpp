#include "uniphy/geometry/fill.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/random.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

void check_count(double cells) {
  if (cells <= static_cast<double>(kMaximumParticles)) return;
  std::ostringstream message;
  message << "filling: expected at most " << kMaximumParticles << " lattice cells, found " << cells;
  throw Error(message.str());
}

// Points of the lattice with `per_side` cells along the longest side; counts only when `points` is
// null.
std::int64_t visit_lattice(const Solid& solid, std::int64_t per_side,
                           std::vector<Vector3d>* points) {
  const Bounds bounds = solid.bounds();
  const Vector3d sides = bounds.sides(), centre = bounds.centre();
  const double spacing = bounds.largest_side() / static_cast<double>(per_side);
  std::int64_t cells[3];
  double total = 1;
  for (int axis = 0; axis < 3; ++axis) {
    cells[axis] = std::max<std::int64_t>(1, std::llround(sides[axis] / spacing));
    total *= static_cast<double>(cells[axis]);
  }
  check_count(total);
  const auto coordinate = [&](int axis, std::int64_t i) {
    const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(cells[axis]) - 0.5;
    return share * sides[axis] + centre[axis];
  };
  std::int64_t count = 0;
  for (std::int64_t i = 0; i < cells[0]; ++i) {
    for (std::int64_t j = 0; j < cells[1]; ++j) {
      for (std::int64_t k = 0; k < cells[2]; ++k) {
        const Vector3d p(coordinate(0, i), coordinate(1, j), coordinate(2, k));
        if (!solid.inside(p)) continue;
        ++count;
        if (points) points->push_back(p);
      }
    }
  }
  return count;
}

}  // namespace

std::vector<Vector3d> fill_lattice(const Solid& solid, std::int64_t per_side) {
  if (per_side < 1) {
    throw Error("filling: expected at least 1 particle a side, found " + std::to_string(per_side));
  }
  std::vector<Vector3d> points;
  if (visit_lattice(solid, per_side, &points) == 0) {
    throw Error("filling: no point of a lattice of " + std::to_string(per_side) +
                " a side lies inside the shape: expected a finer lattice");
  }
  return points;
}

std::vector<Vector3d> fill_lattice_nearest(const Solid& solid, std::int64_t particles) {
  if (particles < 1) {
    throw Error("filling: expected at least 1 particle, found " + std::to_string(particles));
  }
  check_count(static_cast<double>(particles));
  const Bounds bounds = solid.bounds();
  const double cell = std::cbrt(solid.volume() / static_cast<double>(particles));
  const std::int64_t guess = std::max<std::int64_t>(1, std::llround(bounds.largest_side() / cell));
  // The count grows with the resolution but for rounding along the other sides, so the best lattice
  // is near the guess.
  std::int64_t best = 0, best_error = 0;
  for (std::int64_t per_side = std::max<std::int64_t>(1, guess - 2); per_side <= guess + 2;
       ++per_side) {
    const std::int64_t count = visit_lattice(solid, per_side, nullptr);
    const std::int64_t error = std::abs(count - particles);
    if (count > 0 && (best == 0 || error < best_error)) {
      best = per_side;
      best_error = error;
    }
  }
  return fill_lattice(solid, best == 0 ? guess : best);
}

std::vector<Vector3d> fill_lattice_spacing(const Solid& solid, double spacing) {
  if (!(spacing > 0)) {
    std::ostringstream message;
    message << "filling: expected a positive spacing, found " << spacing;
    throw Error(message.str());
  }
  // A side that is a whole number of spacings must not gain a cell by rounding.
  const double cells = std::ceil(solid.bounds().largest_side() / spacing * (1 - 1e-12));
  check_count(cells);
  return fill_lattice(solid, static_cast<std::int64_t>(cells));
}

std::vector<Vector3d> fill_random(const Solid& solid, std::int64_t particles, std::uint64_t seed) {
  if (particles < 1 || particles > kMaximumParticles) {
    throw Error("filling: expected 1 to " + std::to_string(kMaximumParticles) +
                " particles, found " + std::to_string(particles));
  }
  const Bounds bounds = solid.bounds();
  UniformRandom random(seed);
  std::vector<Vector3d> points;
  points.reserve(static_cast<std::size_t>(particles));
  std::int64_t misses = 0;
  while (static_cast<std::int64_t>(points.size()) < particles) {
    const Vector3d p = random.in_box(bounds.min, bounds.max);
    if (solid.inside(p)) {
      points.push_back(p);
      misses = 0;
    } else if (++misses > 1'000'000) {
      throw Error(
          "filling: 1000000 random points in a row missed the shape: expected a shape that "
          "fills more of its bounding box");
    }
  }
  return points;
}

}  // namespace uniphy
