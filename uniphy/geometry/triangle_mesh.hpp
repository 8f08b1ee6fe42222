#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "uniphy/geometry/solid.hpp"

namespace uniphy {

/// A surface of triangles. Its orientation may be inwards or outwards, but one of the two.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;               ///< m
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< indices into vertices

  /// Of the triangles; vertices that no triangle uses do not count.
  Bounds bounds() const;
  /// Directed edges that no triangle runs through the other way: the rims of holes, none for a
  /// closed surface.
  std::vector<std::array<std::int32_t, 2>> open_edges() const;
  /// Σ a·(b×c)/6, each hole closed by a fan to the centre of its rim (exact for closed surfaces and
  /// flat holes). Negative where the faces look inwards; parts that overlap count twice.
  double signed_volume() const;
};

/// Reads a Wavefront OBJ file; polygons are cut into triangles, triangles without area are dropped,
/// vertices at the same place are welded, materials and texture coordinates are ignored. Throws
/// Error naming the file (and the line) where it cannot be read, has no vertices or faces, a
/// coordinate is not a finite number, an index does not exist, every face is degenerate, or the
/// surface encloses no volume.
TriangleMesh read_obj(const std::filesystem::path& file);
/// The same from text; `name` stands for the file in messages.
TriangleMesh parse_obj(const std::string& text, const std::string& name);

}  // namespace uniphy
