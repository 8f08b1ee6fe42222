#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "uniphy/geometry/triangle_mesh.hpp"

namespace uniphy {

/// Faces as a file has them, of any orientation.
struct PolygonMesh {
  std::string name = "mesh";                     ///< of the file, for messages
  std::vector<Eigen::Vector3d> vertices;         ///< m, each place once
  std::vector<std::vector<std::int32_t>> faces;  ///< three corners or more, each vertex once
  std::vector<std::int64_t> lines;               ///< of each face in the file; empty: no file
  std::vector<std::string> warnings;             ///< what was left out
};

/// Reads a Wavefront OBJ file: `v` and `f` lines; everything else is ignored. Vertices at the same
/// place are welded, repeated ones in a row and faces of less than three are dropped, and so are
/// faces that stand in the file more than once (with a warning; of a pair that looks both ways
/// both, where that leaves a closed surface: the wall between two bodies that touch). Throws Error
/// naming the file (and the line) where it cannot be read, has no vertices or faces, a coordinate
/// is not a finite number, an index does not exist, a face names a vertex twice, or all faces are
/// degenerate.
PolygonMesh read_obj(const std::filesystem::path& file);
/// The same from text; `name` stands for the file in messages.
PolygonMesh parse_obj(const std::string& text, const std::string& name);

/// The whole surface of a body.
struct ClosedSurface {
  TriangleMesh mesh;  ///< closed, oriented outwards
  double volume = 0;  ///< m³ of what is inside, counted once where parts overlap
  std::vector<std::string> warnings;
};

/// Closes and orients a surface. Faces that share an edge are a part. Within a part, faces that
/// disagree with their neighbours are turned; holes that make at most 3 % of its surface are closed
/// flat. A part that stands by itself is turned outwards. A part within another is a cavity where
/// it is oriented the other way, and adds nothing where it is oriented alike. All of that is said
/// in a warning. Throws Error naming file and line of a face where a part has larger holes,
/// encloses nothing (a loose sheet, or a fin on a body), or cannot be oriented.
ClosedSurface close_surface(const PolygonMesh& mesh);

}  // namespace uniphy
