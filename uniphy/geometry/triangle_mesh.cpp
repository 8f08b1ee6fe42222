#include "uniphy/geometry/triangle_mesh.hpp"

#include <tiny_obj_loader.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <utility>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/text_file.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

// What tinyobjloader does not report: it reads a malformed number as 0 and keeps indices that do
// not exist. Also keeps the coordinates in double precision, which the loader rounds to float.
class ObjCheck {
 public:
  explicit ObjCheck(const std::string& name) : name_(name) {}

  void read(const std::string& text) {
    for_each_line(text, [&](std::int64_t number, std::string_view line) {
      line_ = number;
      std::vector<std::string_view> words = split_words(line, " \t\r");
      if (words.empty() || words[0][0] == '#') return;
      if (words[0] == "v") read_vertex(words);
      if (words[0] == "f") read_face(words);
    });
    if (vertices.empty()) throw Error(name_ + ": no vertices: expected lines \"v x y z\"");
    if (faces_ == 0) throw Error(name_ + ": no faces: expected lines \"f i j k\"");
    if (largest_index_ > static_cast<std::int64_t>(vertices.size())) {
      line_ = largest_index_line_;
      fail("face index " + std::to_string(largest_index_) + ": expected 1 to " +
           std::to_string(vertices.size()) + ", the number of vertices");
    }
  }

  std::vector<Vector3d> vertices;

 private:
  [[noreturn]] void fail(const std::string& message) const {
    throw Error(name_ + ":" + std::to_string(line_) + ": " + message);
  }

  void read_vertex(const std::vector<std::string_view>& words) {
    if (words.size() < 4)
      fail("vertex: expected 3 coordinates, found " + std::to_string(words.size() - 1));
    Vector3d p;
    for (int axis = 0; axis < 3; ++axis) {
      if (!parse_number(words[axis + 1], &p[axis])) {
        fail("vertex: expected a finite number, found \"" + std::string(words[axis + 1]) + "\"");
      }
    }
    vertices.push_back(p);
  }

  void read_face(const std::vector<std::string_view>& words) {
    if (words.size() < 4) {
      fail("face: expected at least 3 vertices, found " + std::to_string(words.size() - 1));
    }
    for (std::size_t i = 1; i < words.size(); ++i) {
      const std::string_view word = words[i].substr(0, words[i].find('/'));
      std::int64_t index = 0;
      const auto end = std::from_chars(word.data(), word.data() + word.size(), index);
      if (end.ec != std::errc() || end.ptr != word.data() + word.size() || index == 0) {
        fail("face: expected vertex numbers (1, 2, ... or negative), found \"" +
             std::string(words[i]) + "\"");
      }
      // Negative numbers count back from the last vertex read.
      if (index < 0 && -index > static_cast<std::int64_t>(vertices.size())) {
        fail("face index " + std::to_string(index) + ": only " + std::to_string(vertices.size()) +
             " vertices stand above it");
      }
      if (index > largest_index_) {
        largest_index_ = index;
        largest_index_line_ = line_;
      }
    }
    ++faces_;
  }

  std::string name_;
  std::int64_t line_ = 0, faces_ = 0, largest_index_ = 0, largest_index_line_ = 0;
};

// One vertex for each place, in order of appearance; returns the new index of each old one.
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

bool has_area(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double longest =
      std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return (b - a).cross(c - a).norm() > 1e-12 * longest;
}

}  // namespace

Bounds TriangleMesh::bounds() const {
  // Of the vertices that a face uses: stray ones are no part of the surface.
  Bounds bounds{vertices[triangles[0][0]], vertices[triangles[0][0]]};
  for (const auto& triangle : triangles) {
    for (const std::int32_t index : triangle) {
      bounds.min = bounds.min.cwiseMin(vertices[index]);
      bounds.max = bounds.max.cwiseMax(vertices[index]);
    }
  }
  return bounds;
}

std::vector<std::array<std::int32_t, 2>> TriangleMesh::open_edges() const {
  // Passes of each edge from its smaller to its larger index, less those the other way.
  std::map<std::pair<std::int32_t, std::int32_t>, int> balance;
  for (const auto& triangle : triangles) {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t from = triangle[k], to = triangle[(k + 1) % 3];
      balance[{std::min(from, to), std::max(from, to)}] += from < to ? 1 : -1;
    }
  }
  std::vector<std::array<std::int32_t, 2>> open;
  for (const auto& [edge, passes] : balance) {
    for (int k = 0; k < passes; ++k) open.push_back({edge.first, edge.second});
    for (int k = 0; k < -passes; ++k) open.push_back({edge.second, edge.first});
  }
  return open;
}

double TriangleMesh::signed_volume() const {
  const Vector3d origin = bounds().centre();  // keeps the terms small
  const auto term = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    return (a - origin).dot((b - origin).cross(c - origin)) / 6;
  };
  double sum = 0;
  for (const auto& [i, j, k] : triangles) sum += term(vertices[i], vertices[j], vertices[k]);

  // Rims: sets of open edges that share vertices.
  const auto open = open_edges();
  std::map<std::int32_t, std::int32_t> parent;
  for (const auto& [from, to] : open) parent[from] = from, parent[to] = to;
  const auto root = [&parent](std::int32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const auto& [from, to] : open) parent[root(from)] = root(to);
  std::map<std::int32_t, std::pair<Vector3d, int>> rims;
  for (const auto& [from, to] : open) {
    auto& rim = rims.try_emplace(root(from), Vector3d::Zero(), 0).first->second;
    rim.first += 0.5 * (vertices[from] + vertices[to]);
    ++rim.second;
  }
  for (const auto& [from, to] : open) {
    const auto& [total, count] = rims.at(root(from));
    sum += term(vertices[to], vertices[from], total / count);
  }
  return sum;
}

TriangleMesh parse_obj(const std::string& text, const std::string& name) {
  ObjCheck check(name);
  check.read(text);

  tinyobj::ObjReader reader;
  tinyobj::ObjReaderConfig options;
  options.triangulate = true;
  // No second argument: material files named by the mesh are not looked for.
  if (!reader.ParseFromString(text, "", options)) {
    throw Error(name + ": not a readable OBJ file: " + reader.Error());
  }

  TriangleMesh mesh;
  const std::vector<std::int32_t> welded = weld(check.vertices, &mesh.vertices);
  std::size_t dropped = 0;
  for (const tinyobj::shape_t& shape : reader.GetShapes()) {
    const std::vector<tinyobj::index_t>& indices = shape.mesh.indices;
    for (std::size_t corner = 0; corner + 2 < indices.size(); corner += 3) {
      std::array<std::int32_t, 3> triangle;
      for (int k = 0; k < 3; ++k) triangle[k] = welded[indices[corner + k].vertex_index];
      if (has_area(mesh.vertices[triangle[0]], mesh.vertices[triangle[1]],
                   mesh.vertices[triangle[2]])) {
        mesh.triangles.push_back(triangle);
      } else {
        ++dropped;
      }
    }
  }
  if (mesh.triangles.empty()) {
    throw Error(name + ": all " + std::to_string(dropped) +
                " triangles are degenerate (no area): expected a surface");
  }
  const double size = mesh.bounds().sides().norm();
  if (!(std::abs(mesh.signed_volume()) > 1e-9 * size * size * size)) {
    throw Error(
        name + ": the " + std::to_string(mesh.triangles.size()) +
        " triangles enclose no volume: expected a closed surface with faces oriented alike");
  }
  return mesh;
}

TriangleMesh read_obj(const std::filesystem::path& file) {
  return parse_obj(read_text_file(file), file.string());
}

}  // namespace uniphy
