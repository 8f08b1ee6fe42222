#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <unordered_map>
#include <vector>

#include "uniphy/geometry/triangle_mesh.hpp"

namespace uniphy {

/// Faces of a mesh that hang together, closed, with neighbours oriented alike.
struct MeshPart {
  std::int32_t face = 0;  ///< the first of it, by its number in the whole mesh
  std::size_t faces = 0;
  double hole = 0;  ///< m², what was closed
  TriangleMesh mesh;
  std::unordered_map<std::int32_t, std::int32_t> corner;  ///< vertex of `mesh` by that of the whole
  Bounds bounds;
  double volume = 0;  ///< m³, negative where the faces look inwards
};

/// Turns parts outwards, but for those within another, which keep their orientation relative to the
/// outermost part round them: the other way, a cavity. warn(part, text) tells of parts that were
/// turned on their own and of such that lie in what is filled already.
void orient_parts(std::vector<MeshPart>& parts,
                  const std::function<void(const MeshPart&, const std::string&)>& warn);

}  // namespace uniphy
