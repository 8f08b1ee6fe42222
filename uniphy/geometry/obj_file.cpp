#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <unordered_set>
#include <utility>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/polygon_mesh.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/text_lines.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using Face = std::vector<std::int32_t>;

constexpr std::size_t kMaximumBytes = std::size_t{1} << 30;

/// The lines of a file as they are: vertices not welded, faces not checked against each other.
class ObjParser {
 public:
  ObjParser(const std::string& text, const std::string& name) : lines_(text, name), name_(name) {
    while (lines_.next()) {
      std::vector<std::string_view> words = lines_.words();
      const std::int64_t line = lines_.line_number();
      while (!words.empty() && words.back() == "\\" && lines_.next()) {  // goes on
        words.pop_back();
        const auto more = lines_.words();
        words.insert(words.end(), more.begin(), more.end());
      }
      if (words.empty()) continue;
      if (words[0] == "v") read_vertex(words);
      if (words[0] == "f") read_face(words, line);
    }
    if (vertices.empty()) throw Error(name_ + ": no vertices: expected lines \"v x y z\"");
    if (faces.empty()) throw Error(name_ + ": no faces: expected lines \"f i j k\"");
    if (largest_ > static_cast<std::int64_t>(vertices.size())) {
      throw Error(name_ + ":" + std::to_string(largest_line_) + ": face index " +
                  std::to_string(largest_) + ": expected 1 to " + std::to_string(vertices.size()) +
                  ", the number of vertices");
    }
  }

  std::vector<Vector3d> vertices;
  std::vector<Face> faces;  ///< indices from 0
  std::vector<std::int64_t> face_lines;

 private:
  void read_vertex(const std::vector<std::string_view>& words) {
    if (words.size() < 4) {
      lines_.fail("vertex: expected 3 coordinates, found " + std::to_string(words.size() - 1));
    }
    Vector3d p;
    for (int axis = 0; axis < 3; ++axis) p[axis] = lines_.number(words[axis + 1], "vertex: ");
    vertices.push_back(p);
  }

  void read_face(const std::vector<std::string_view>& words, std::int64_t line) {
    if (words.size() < 4) {
      lines_.fail("face: expected at least 3 vertices, found " + std::to_string(words.size() - 1));
    }
    Face face;
    for (std::size_t i = 1; i < words.size(); ++i) {
      const std::string_view word = words[i].substr(0, words[i].find('/'));
      std::int64_t index = 0;
      const auto end = std::from_chars(word.data(), word.data() + word.size(), index);
      if (end.ec != std::errc() || end.ptr != word.data() + word.size() || index == 0) {
        lines_.fail("face: expected vertex numbers (1, 2, ... or negative), found " +
                    quoted_word(words[i]));
      }
      // Negative numbers count back from the last vertex read.
      const auto known = static_cast<std::int64_t>(vertices.size());
      if (index < -known) {
        lines_.fail("face index " + std::to_string(index) + ": only " + std::to_string(known) +
                    " vertices stand above it");
      }
      if (index > largest_) {
        largest_ = index;
        largest_line_ = line;
      }
      face.push_back(static_cast<std::int32_t>(index < 0 ? known + index : index - 1));
    }
    faces.push_back(std::move(face));
    face_lines.push_back(line);
  }

  TextLines lines_;
  std::string name_;
  std::int64_t largest_ = 0, largest_line_ = 0;
};

/// One vertex for each place, in order of appearance; returns the new index of each old one.
std::vector<std::int32_t> weld(const std::vector<Vector3d>& vertices,
                               std::vector<Vector3d>* places) {
  std::map<std::array<double, 3>, std::int32_t> known;
  std::vector<std::int32_t> index;
  index.reserve(vertices.size());
  for (const Vector3d& p : vertices) {
    const auto [entry, added] =
        known.try_emplace({p[0], p[1], p[2]}, static_cast<std::int32_t>(places->size()));
    if (added) places->push_back(p);
    index.push_back(entry->second);
  }
  return index;
}

/// The corners without repetitions in a row.
Face without_repetitions(const Face& corners, const std::vector<std::int32_t>& welded) {
  Face face;
  for (const std::int32_t corner : corners) {
    if (face.empty() || face.back() != welded[corner]) face.push_back(welded[corner]);
  }
  while (face.size() > 1 && face.back() == face.front()) face.pop_back();
  return face;
}

/// A face from its smallest index on; `turned` the other way round.
Face canonical(Face face, bool turned) {
  if (turned) std::reverse(face.begin(), face.end());
  std::rotate(face.begin(), std::min_element(face.begin(), face.end()), face.end());
  return face;
}

/// Whether every edge belongs to an even number of the faces [k] with keep[k].
bool is_closed(const std::vector<Face>& faces, const std::vector<bool>& keep) {
  std::map<std::pair<std::int32_t, std::int32_t>, int> passes;
  for (std::size_t k = 0; k < faces.size(); ++k) {
    for (std::size_t i = 0; keep[k] && i < faces[k].size(); ++i) {
      ++passes[std::minmax(faces[k][i], faces[k][(i + 1) % faces[k].size()])];
    }
  }
  return !passes.empty() && std::all_of(passes.begin(), passes.end(),
                                        [](const auto& entry) { return entry.second % 2 == 0; });
}

/// Which faces stay where some stand in the file more than once.
std::vector<bool> without_doubles(const std::vector<Face>& faces) {
  struct Group {
    std::vector<std::size_t> alike, turned;
  };
  std::map<Face, Group> groups;
  for (std::size_t k = 0; k < faces.size(); ++k) {
    const auto other = groups.find(canonical(faces[k], true));
    if (other != groups.end()) {
      other->second.turned.push_back(k);
    } else {
      groups[canonical(faces[k], false)].alike.push_back(k);
    }
  }
  std::vector<bool> keep(faces.size(), false);
  std::vector<std::size_t> walls;  // the first of each pair that looks both ways
  for (const auto& [key, group] : groups) {
    if (group.alike.size() == group.turned.size()) {
      walls.push_back(group.alike[0]);
    } else {
      const bool alike = group.alike.size() > group.turned.size();
      keep[(alike ? group.alike : group.turned)[0]] = true;
    }
  }
  if (!walls.empty() && !is_closed(faces, keep)) {
    for (const std::size_t k : walls) keep[k] = true;
  }
  return keep;
}

}  // namespace

PolygonMesh parse_obj(const std::string& text, const std::string& name) {
  const ObjParser file(text, name);
  PolygonMesh mesh;
  mesh.name = name;
  const std::vector<std::int32_t> welded = weld(file.vertices, &mesh.vertices);
  std::vector<Face> faces;
  std::vector<std::int64_t> lines;
  for (std::size_t k = 0; k < file.faces.size(); ++k) {
    Face face = without_repetitions(file.faces[k], welded);
    if (face.size() < 3) continue;
    if (std::unordered_set<std::int32_t>(face.begin(), face.end()).size() < face.size()) {
      throw Error(name + ":" + std::to_string(file.face_lines[k]) +
                  ": face: expected a polygon that passes each vertex once, found one that comes "
                  "back to a vertex");
    }
    faces.push_back(std::move(face));
    lines.push_back(file.face_lines[k]);
  }
  if (faces.empty()) {
    throw Error(name + ": all " + std::to_string(file.faces.size()) +
                " faces are degenerate (no area): expected a surface");
  }
  const std::vector<bool> keep = without_doubles(faces);
  std::int64_t left_out = 0, first = 0;
  for (std::size_t k = 0; k < faces.size(); ++k) {
    if (keep[k]) {
      mesh.faces.push_back(std::move(faces[k]));
      mesh.lines.push_back(lines[k]);
    } else if (left_out++ == 0) {
      first = lines[k];
    }
  }
  if (left_out > 0) {
    mesh.warnings.push_back(
        name + ":" + std::to_string(first) + ": " + std::to_string(left_out) +
        " faces repeat or face another one of the same corners (this is the first) and "
        "are left out");
  }
  return mesh;
}

PolygonMesh read_obj(const std::filesystem::path& file) {
  return parse_obj(read_text_file(file, kMaximumBytes), file.string());
}

}  // namespace uniphy
