#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "uniphy/geometry/solid.hpp"

namespace uniphy {

/// A surface of triangles, oriented outwards where it bounds a body.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;               ///< m
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< indices into vertices

  /// Of the triangles; vertices that no triangle uses do not count.
  Bounds bounds() const;
  /// Σ a·(b×c)/6 of a closed surface, m³. Negative where the faces look inwards; what is inside of
  /// several parts counts several times.
  double signed_volume() const;
  /// m².
  double area() const;
};

/// Whether a triangle has an area beyond rounding.
bool has_area(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Of the space that a closed surface fills, counted as often as it lies inside of parts, the share
/// that is left when it is counted once: 1 where no parts overlap. Found along 256² or more lines
/// parallel to x; exact for boxes along the axes, to some 1e-4 for curved surfaces.
double counted_once(const TriangleMesh& mesh);

}  // namespace uniphy
