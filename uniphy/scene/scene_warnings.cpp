#include "uniphy/scene/scene_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>

namespace uniphy {
namespace {

/// Particles that a body ought to have in a cell: two along each side, the usual choice for MPM.
constexpr double kGoodPerCell = 8;

std::ptrdiff_t count_of(const PlacedScene& placed, std::size_t body) {
  return placed.first[body + 1] - placed.first[body];
}

double volume_of(const PlacedScene& placed, std::size_t body) {
  double volume = 0;
  for (std::ptrdiff_t p = placed.first[body]; p < placed.first[body + 1]; ++p)
    volume += placed.volume[p];
  return volume;
}

/// Half of a body's particle spacing, m.
double half_spacing(const PlacedScene& placed, std::size_t body) {
  return 0.5 * std::cbrt(volume_of(placed, body) / static_cast<double>(count_of(placed, body)));
}

/// All particles of a scene, found by the cell of width `reach` (m) that holds them.
class NearParticles {
 public:
  NearParticles(const PlacedScene& placed, double reach) : placed_(placed), reach_(reach) {
    side_ = static_cast<std::int64_t>(std::ceil(1 / reach)) + 3;
    for (std::ptrdiff_t p = 0; p < placed.particles(); ++p) cells_[key(p, 0, 0, 0)].push_back(p);
  }

  /// visit(q, distance in m) for every particle of another body within reach of p.
  template <class Visit>
  void others(std::ptrdiff_t p, const Visit& visit) const {
    for (int k = 0; k < 27; ++k) {
      const auto found = cells_.find(key(p, k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
      if (found == cells_.end()) continue;
      for (const std::ptrdiff_t q : found->second) {
        if (placed_.body[q] == placed_.body[p]) continue;
        const double distance = (at(p) - at(q)).norm();
        if (distance < reach_) visit(q, distance);
      }
    }
  }

 private:
  Eigen::Map<const Eigen::Vector3d> at(std::ptrdiff_t p) const {
    return Eigen::Map<const Eigen::Vector3d>(placed_.x.data() + 3 * p);
  }
  std::int64_t key(std::ptrdiff_t p, int i, int j, int k) const {
    const auto cell = [&](int axis, int offset) {
      return static_cast<std::int64_t>(std::floor(placed_.x[3 * p + axis] / reach_)) + offset + 1;
    };
    return (cell(0, i) * side_ + cell(1, j)) * side_ + cell(2, k);
  }

  const PlacedScene& placed_;
  double reach_;
  std::int64_t side_;
  std::unordered_map<std::int64_t, std::vector<std::ptrdiff_t>> cells_;
};

}  // namespace

std::vector<double> particles_per_cell(const PlacedScene& placed) {
  std::vector<double> result;
  for (std::size_t b = 0; b + 1 < placed.first.size(); ++b) {
    const double cells = volume_of(placed, b) / std::pow(placed.grid.dx(), 3);
    result.push_back(static_cast<double>(count_of(placed, b)) / cells);
  }
  return result;
}

std::vector<double> body_gaps(const PlacedScene& placed, double reach) {
  const std::size_t bodies = placed.first.size() - 1;
  std::vector<double> gaps(bodies * bodies, std::numeric_limits<double>::infinity());
  if (bodies < 2) return gaps;
  std::vector<double> half;
  for (std::size_t b = 0; b < bodies; ++b) half.push_back(half_spacing(placed, b));
  const double widest = *std::max_element(half.begin(), half.end());
  const double dx = placed.grid.dx();
  const NearParticles near(placed, reach * dx + 2 * widest);
  for (std::ptrdiff_t p = 0; p < placed.particles(); ++p) {
    near.others(p, [&](std::ptrdiff_t q, double distance) {
      const std::size_t a = placed.body[p], b = placed.body[q];
      const double gap = std::max(0.0, (distance - half[a] - half[b]) / dx);
      if (gap > reach) return;
      double& least = gaps[a * bodies + b];
      least = std::min(least, gap);
    });
  }
  return gaps;
}

std::optional<std::string> sparse_warning(std::int64_t particles, double volume, double dx) {
  const double cells = volume / (dx * dx * dx);
  const double density = static_cast<double>(particles) / cells;
  if (density >= 1 - 1e-9) return {};
  return fmt::format(
      "{} particles are {:.2g} a grid cell, and a body of less than one falls apart as dust; "
      "expected at least {:.0f}, better {:.0f} (8 a cell), or a coarser grid",
      particles, density, std::ceil(cells), std::ceil(kGoodPerCell * cells));
}

std::vector<std::string> scene_warnings(const SceneDescription& scene, const PlacedScene& placed) {
  std::vector<std::string> warnings;
  // The margin is the user's to use up; the limit itself is not.
  const double limit = placed.stable_dt / scene.safety;
  if (placed.grid.dt > limit) {
    warnings.push_back(fmt::format(
        "dt is {:.3g} s, beyond the stable {:.3g} s; the run may blow up (auto takes {:.3g} s)",
        placed.grid.dt, limit, placed.stable_dt));
  }
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyDescription& body = scene.bodies[b];
    const auto warn = [&](const std::optional<std::string>& text) {
      if (text) warnings.push_back(fmt::format("body \"{}\": {}", body.name, *text));
    };
    warn(sparse_warning(count_of(placed, b), volume_of(placed, b), placed.grid.dx()));
    warn(time_step_warning(body.law, body.law_origin, placed.grid.dt));
    if (!body.law_origin.determined) {
      warn(
          "its law was fitted to a motion that did not show the material (no wall acted); any "
          "other would have fitted as well");
    }
  }
  const std::vector<double> gaps = body_gaps(placed, kSharedCells);
  for (std::size_t a = 0; a < scene.bodies.size(); ++a) {
    for (std::size_t b = a + 1; b < scene.bodies.size(); ++b) {
      const double gap = gaps[a * scene.bodies.size() + b];
      if (!(gap > kTouchingCells && gap < kSharedCells)) continue;
      warnings.push_back(fmt::format(
          "bodies \"{}\" and \"{}\" are {:.2g} cells apart: nearer than {:g} they share nodes of "
          "the grid, drag each other along and stick when they part; expected a wider gap, a finer "
          "grid, or bodies that touch",
          scene.bodies[a].name, scene.bodies[b].name, gap, kSharedCells));
    }
  }
  return warnings;
}

}  // namespace uniphy
