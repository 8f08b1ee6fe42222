#include "uniphy/inference/resolution.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>
#include <memory>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/cloud_solid.hpp"
#include "uniphy/geometry/fill.hpp"
#include "uniphy/geometry/polygon_mesh.hpp"
#include "uniphy/geometry/winding_number.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

std::vector<Vector3d> rows_of(const std::vector<double>& numbers) {
  std::vector<Vector3d> rows;
  for (std::size_t k = 0; k + 2 < numbers.size(); k += 3)
    rows.emplace_back(numbers[k], numbers[k + 1], numbers[k + 2]);
  return rows;
}

SolidPtr solid_of(const Observation& seen, const std::string& name,
                  std::vector<std::string>& warnings) {
  if (seen.vertices.empty())
    return std::make_shared<CloudSolid>(rows_of(seen.start()), seen.volume);
  PolygonMesh mesh;
  mesh.name = name + ": /body";
  mesh.vertices = rows_of(seen.vertices);
  for (std::size_t k = 0; k + 2 < seen.triangles.size(); k += 3) {
    std::vector<std::int32_t>& face = mesh.faces.emplace_back();
    for (std::size_t c = k; c < k + 3; ++c)
      face.push_back(static_cast<std::int32_t>(seen.triangles[c]));
  }
  const ClosedSurface surface = close_surface(mesh);
  warnings.insert(warnings.end(), surface.warnings.begin(), surface.warnings.end());
  return std::make_shared<MeshSolid>(surface);
}

void fill_body(Observation& seen, const Solid& solid, double particles_a_cell,
               const std::string& name) {
  const double spacing = 1 / (seen.grid * std::cbrt(particles_a_cell));
  std::vector<Vector3d> x;
  try {
    x = fill_lattice_spacing(solid, spacing);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: /body: {}", name, error.what()));
  }
  if (!seen.tracked() && seen.cloud == 0)
    seen.tracers.assign(seen.x.begin(), seen.x.begin() + 3 * seen.particles);
  seen.particles = static_cast<std::int64_t>(x.size());
  seen.volume.assign(x.size(), solid.volume() / static_cast<double>(x.size()));
  seen.body.clear();
  for (const Vector3d& p : x) seen.body.insert(seen.body.end(), p.data(), p.data() + 3);
  seen.vertices.clear();
  seen.triangles.clear();
}

/// Walls are planes of nodes, (bound − 1)/grid from either side.
void set_grid(Observation& seen, const Resolution& resolution, const std::string& name) {
  const double ratio = static_cast<double>(resolution.grid) / seen.grid;
  const double bound = (seen.bound - 1) * ratio + 1;
  if (std::abs(bound - std::round(bound)) > 1e-9 || std::round(bound) < 1) {
    throw Error(fmt::format(
        "{}: resolution.grid: expected a grid that has nodes where the walls stand, {} / {} of the "
        "side, found {}",
        name, seen.bound - 1, seen.grid, resolution.grid));
  }
  seen.bound = static_cast<int>(std::lround(bound));
  seen.dt /= ratio;
  seen.grid = resolution.grid;
}

}  // namespace

Observation at_resolution(const Observation& observed, const Resolution& resolution,
                          const std::string& name, std::vector<std::string>& warnings) {
  Observation seen = observed;
  const bool other_grid = resolution.grid > 0 && resolution.grid != seen.grid;
  const bool fills = other_grid || !seen.vertices.empty();
  const SolidPtr solid = fills ? solid_of(seen, name, warnings) : nullptr;
  if (other_grid) set_grid(seen, resolution, name);
  if (resolution.dt > 0) seen.dt = resolution.dt;
  if (fills) fill_body(seen, *solid, resolution.particles_a_cell, name);
  return seen;
}

}  // namespace uniphy
