#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/mesh_part.hpp"
#include "uniphy/geometry/polygon_mesh.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using Index = std::int32_t;

/// Holes up to this part of a surface are closed flat. A ball without a cap of 1.4 % loses 0.3 % of
/// its volume so; a box without one of its six faces (17 %) is another thing than a box.
constexpr double kLargestHole = 0.03;
/// A volume below this part of the cube of a surface's size is that of a sheet.
constexpr double kNoVolume = 1e-9;

/// Sets that are joined; the smallest member stands for the set.
class Sets {
 public:
  explicit Sets(std::size_t size) : parent_(size) {
    std::iota(parent_.begin(), parent_.end(), Index{0});
  }
  Index of(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(Index a, Index b) {
    a = of(a), b = of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<Index> parent_;
};

/// A face at one of its edges, low < high.
struct Side {
  Index low, high, face;
  bool upwards;  ///< the face, as the file has it, passes from low to high
  bool operator<(const Side& o) const {
    return std::tie(low, high, face) < std::tie(o.low, o.high, o.face);
  }
};

class Closing {
 public:
  explicit Closing(const PolygonMesh& mesh)
      : mesh_(mesh),
        sets_(mesh.faces.size()),
        turned_(mesh.faces.size(), 0),
        vertices_(mesh.vertices) {
    out_.warnings = mesh.warnings;
  }

  ClosedSurface run() {
    collect_sides();
    orient_faces();
    close_holes();
    std::vector<MeshPart> parts = make_parts();
    orient_parts(parts, [&](const MeshPart& part, const std::string& text) {
      warn(at(part.face) + ": the part from here on " + text);
    });
    for (const MeshPart& part : parts) {
      const Index before = Index(out_.mesh.vertices.size());
      for (const auto& [a, b, c] : part.mesh.triangles) {
        out_.mesh.triangles.push_back({before + a, before + b, before + c});
      }
      out_.mesh.vertices.insert(out_.mesh.vertices.end(), part.mesh.vertices.begin(),
                                part.mesh.vertices.end());
    }
    const double share = counted_once(out_.mesh), sum = out_.mesh.signed_volume();
    out_.volume = sum * share;
    if (share < 1 - 1e-6) {
      warn(fmt::format("{}: parts overlap and count once there: {:.6g} of {:.6g} cubic units",
                       mesh_.name, out_.volume, sum));
    }
    return std::move(out_);
  }

 private:
  std::string at(Index face) const {
    return mesh_.lines.empty() ? fmt::format("{}: face {}", mesh_.name, face + 1)
                               : fmt::format("{}:{}", mesh_.name, mesh_.lines[face]);
  }
  std::string edge(const Side& s) const {
    const Vector3d &a = mesh_.vertices[s.low], &b = mesh_.vertices[s.high];
    return fmt::format("the edge from ({:g}, {:g}, {:g}) to ({:g}, {:g}, {:g})", a[0], a[1], a[2],
                       b[0], b[1], b[2]);
  }
  [[noreturn]] void fail(Index face, const std::string& message) const {
    throw Error(at(face) + ": " + message);
  }
  void warn(const std::string& text) { out_.warnings.push_back(text); }
  bool upwards(const Side& s) const { return s.upwards != (turned_[s.face] != 0); }

  void collect_sides() {
    for (std::size_t f = 0; f < mesh_.faces.size(); ++f) {
      const auto& face = mesh_.faces[f];
      for (std::size_t i = 0; i < face.size(); ++i) {
        const Index from = face[i], to = face[(i + 1) % face.size()];
        sides_.push_back({std::min(from, to), std::max(from, to), Index(f), from < to});
      }
    }
    std::sort(sides_.begin(), sides_.end());
  }

  /// visit(first, last) for the sides of each edge.
  template <class Visit>
  void for_each_edge(const Visit& visit) const {
    for (std::size_t first = 0, last; first < sides_.size(); first = last) {
      for (last = first; last < sides_.size() && sides_[last].low == sides_[first].low &&
                         sides_[last].high == sides_[first].high;) {
        ++last;
      }
      visit(&sides_[first], &sides_[0] + last);
    }
  }

  /// Turns the fewest faces of each part so that neighbours pass their edge in opposite directions.
  void orient_faces() {
    std::vector<std::vector<std::pair<Index, const Side*>>> neighbours(mesh_.faces.size());
    for_each_edge([&](const Side* first, const Side* last) {
      if (last - first != 2) return;  // more: where parts touch, which do not decide for each other
      neighbours[first[0].face].emplace_back(first[1].face, first);
      neighbours[first[1].face].emplace_back(first[0].face, first);
      sets_.join(first[0].face, first[1].face);
    });
    std::vector<char> seen(mesh_.faces.size(), 0);
    for (std::size_t start = 0; start < mesh_.faces.size(); ++start) {
      if (seen[start]) continue;
      std::vector<Index> part{Index(start)};
      seen[start] = 1;
      for (std::size_t k = 0; k < part.size(); ++k) {
        for (const auto& [other, side] : neighbours[part[k]]) {
          const bool alike = side[0].upwards != side[1].upwards;
          const char turn = alike ? turned_[part[k]] : char(!turned_[part[k]]);
          if (!seen[other]) {
            seen[other] = 1;
            turned_[other] = turn;
            part.push_back(other);
          } else if (turned_[other] != turn) {
            fail(other, edge(side[0]) +
                            " joins faces that cannot be oriented alike: expected a "
                            "surface with two sides");
          }
        }
      }
      const auto turned =
          std::count_if(part.begin(), part.end(), [&](Index f) { return turned_[f] != 0; });
      const bool other_way = 2 * turned > std::ptrdiff_t(part.size());
      Index first = -1;
      for (const Index f : part) {
        turned_[f] = char((turned_[f] != 0) != other_way);
        if (turned_[f] && (first < 0 || f < first)) first = f;
      }
      if (first >= 0) {
        warn(
            fmt::format("{}: {} of {} faces were turned to agree with their neighbours (this is "
                        "the first)",
                        at(first), other_way ? part.size() - turned : turned, part.size()));
      }
    }
  }

  /// Where a part passes an edge an odd number of times is a rim: of a hole, or (without area)
  /// where a corner of one face stands on the edge of another.
  void close_holes() {
    struct Rim {
      Index from, to, face;
    };
    std::vector<Rim> rims;
    for_each_edge([&](const Side* first, const Side* last) {
      std::map<Index, std::pair<int, int>> of_part;  // passes, passes upwards less downwards
      for (const Side* s = first; s < last; ++s) {
        auto& [passes, balance] = of_part[sets_.of(s->face)];
        ++passes;
        balance += upwards(*s) ? 1 : -1;
      }
      for (const auto& [part, passes] : of_part) {
        if (passes.second == 0) continue;
        if (std::abs(passes.second) > 1) {
          fail(part, edge(*first) + " belongs to faces that are not oriented alike");
        }
        const bool up = passes.second > 0;
        rims.push_back({up ? first->low : first->high, up ? first->high : first->low, part});
      }
    });
    Sets corners(mesh_.vertices.size());
    std::map<Index, Index> face_at;  // of a rim
    std::map<Index, int> balance;
    for (const Rim& rim : rims) {
      corners.join(rim.from, rim.to);
      for (const Index corner : {rim.from, rim.to}) {
        sets_.join(face_at.try_emplace(corner, rim.face).first->second, rim.face);
      }
      ++balance[rim.from];
      --balance[rim.to];
    }
    std::map<Index, std::pair<Vector3d, int>> centres;
    for (const Rim& rim : rims) {
      if (balance[rim.from] != 0) {
        fail(rim.face, edge({rim.from, rim.to, rim.face, true}) +
                           " borders on faces that are not oriented alike");
      }
      auto& [sum, count] =
          centres.try_emplace(corners.of(rim.from), Vector3d::Zero(), 0).first->second;
      sum += vertices_[rim.from];
      ++count;
    }
    std::map<Index, Index> centre_of;
    for (const auto& [rim, centre] : centres) {
      centre_of[rim] = Index(vertices_.size());
      vertices_.push_back(centre.first / centre.second);
    }
    for (const Rim& rim : rims) {
      lids_.push_back({sets_.of(rim.face), {rim.to, rim.from, centre_of[corners.of(rim.from)]}});
    }
  }

  std::vector<MeshPart> make_parts() {
    std::map<Index, MeshPart> by_face;
    const auto corner = [&](MeshPart& part, Index vertex) {
      const auto [entry, added] = part.corner.try_emplace(vertex, Index(part.mesh.vertices.size()));
      if (added) part.mesh.vertices.push_back(vertices_[vertex]);
      return entry->second;
    };
    const auto add = [&](MeshPart& part, Index a, Index b, Index c) {
      if (!has_area(vertices_[a], vertices_[b], vertices_[c])) return;
      part.mesh.triangles.push_back({corner(part, a), corner(part, b), corner(part, c)});
    };
    for (std::size_t f = 0; f < mesh_.faces.size(); ++f) {
      const auto& face = mesh_.faces[f];
      MeshPart& part = by_face[sets_.of(Index(f))];
      part.face = sets_.of(Index(f));
      ++part.faces;
      // A fan: right for any flat polygon, convex or not, as what it covers twice cancels out.
      for (std::size_t k = 2; k < face.size(); ++k) {
        const Index b = turned_[f] ? face[k] : face[k - 1], c = turned_[f] ? face[k - 1] : face[k];
        add(part, face[0], b, c);
      }
    }
    for (const auto& [face, lid] : lids_) {
      MeshPart& part = by_face.at(face);
      const std::size_t before = part.mesh.triangles.size();
      add(part, lid[0], lid[1], lid[2]);
      if (part.mesh.triangles.size() == before) continue;
      const Vector3d &a = vertices_[lid[0]], &b = vertices_[lid[1]], &c = vertices_[lid[2]];
      part.hole += 0.5 * (b - a).cross(c - a).norm();
    }
    std::vector<MeshPart> parts;
    for (auto& [face, part] : by_face) {
      check(part);
      parts.push_back(std::move(part));
    }
    return parts;
  }

  void check(MeshPart& part) {
    if (part.mesh.triangles.empty()) fail(part.face, "the faces from here on have no area");
    part.bounds = part.mesh.bounds();
    part.volume = part.mesh.signed_volume();
    const double size = part.bounds.sides().norm(), area = part.mesh.area();
    const std::string what = fmt::format("the part of {} faces from here on", part.faces);
    if (!(std::abs(part.volume) > kNoVolume * size * size * size)) {
      fail(part.face, what + " encloses no volume: expected a closed surface");
    }
    if (part.hole > kLargestHole * area) {
      fail(part.face, fmt::format("{} is open: expected holes of at most {:g} % of its surface, "
                                  "found {:.3g} %",
                                  what, 100 * kLargestHole, 100 * part.hole / area));
    }
    if (part.hole > 1e-9 * area) {
      warn(fmt::format("{}: holes in {}, {:.2g} % of its surface, are closed flat", at(part.face),
                       what, 100 * part.hole / area));
    }
  }

  const PolygonMesh& mesh_;
  std::vector<Side> sides_;
  Sets sets_;  ///< of faces: the parts
  std::vector<char> turned_;
  std::vector<Vector3d> vertices_;  ///< and the centres of holes
  std::vector<std::pair<Index, std::array<Index, 3>>> lids_;
  ClosedSurface out_;
};

}  // namespace

ClosedSurface close_surface(const PolygonMesh& mesh) { return Closing(mesh).run(); }

}  // namespace uniphy
