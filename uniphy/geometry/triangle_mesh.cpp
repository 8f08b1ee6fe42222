#include "uniphy/geometry/triangle_mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace uniphy {
namespace {

using Eigen::Vector3d;

constexpr int kLines = 256;         // a side
constexpr std::size_t kEdges = 64;  // coordinates of a mesh of few corners, between which lines lie

/// A line at `position` that stands for a strip of `width`.
struct Strip {
  double position, width;
};

/// Strips across [low, high]. Where the corners have few coordinates, as in boxes, no strip
/// contains one, so that flat faces are integrated without an error.
std::vector<Strip> strips(const TriangleMesh& mesh, int axis) {
  std::vector<double> edges;
  for (const auto& triangle : mesh.triangles) {
    for (const std::int32_t corner : triangle) edges.push_back(mesh.vertices[corner][axis]);
  }
  std::sort(edges.begin(), edges.end());
  const double low = edges.front(), size = edges.back() - low;
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  if (edges.size() > kEdges) edges = {low, low + size};
  std::vector<Strip> result;
  for (std::size_t k = 1; k < edges.size(); ++k) {
    const double gap = edges[k] - edges[k - 1];
    const int count = std::max(1, static_cast<int>(std::ceil(kLines * gap / size)));
    for (int i = 0; i < count; ++i) {
      result.push_back({edges[k - 1] + gap * (i + 0.5) / count, gap / count});
    }
  }
  return result;
}

/// Strips whose line lies between the two coordinates.
std::pair<std::size_t, std::size_t> range(const std::vector<Strip>& strips, double low,
                                          double high) {
  const auto before = [](const Strip& strip, double value) { return strip.position < value; };
  const auto after = [](double value, const Strip& strip) { return value < strip.position; };
  return {std::lower_bound(strips.begin(), strips.end(), low, before) - strips.begin(),
          std::upper_bound(strips.begin(), strips.end(), high, after) - strips.begin()};
}

/// Where the triangle begins and ends along z in the plane of this y.
std::pair<double, double> span(const std::array<const Vector3d*, 3>& corners, double y) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (int k = 0; k < 3; ++k) {
    const Vector3d &p = *corners[k], &q = *corners[(k + 1) % 3];
    if ((p[1] < y) == (q[1] < y)) continue;
    const double z = p[2] + (y - p[1]) / (q[1] - p[1]) * (q[2] - p[2]);
    low = std::min(low, z);
    high = std::max(high, z);
  }
  return {low, high};
}

/// Twice the area of (from, to, point) in the plane of y and z, the same but for its sign in both
/// triangles of an edge, so that a line never passes between the two.
double side(const TriangleMesh& mesh, std::int32_t from, std::int32_t to, double y, double z) {
  const bool turned = from > to;
  const Vector3d &p = mesh.vertices[turned ? to : from], &q = mesh.vertices[turned ? from : to];
  const double twice = (q[1] - p[1]) * (z - p[2]) - (q[2] - p[2]) * (y - p[1]);
  return turned ? -twice : twice;
}

/// Where a line enters (+1) or leaves (-1) a part.
struct Crossing {
  std::size_t line;
  double x;
  int change;
  bool operator<(const Crossing& other) const {
    return line != other.line ? line < other.line : x < other.x;
  }
};

}  // namespace

bool has_area(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double longest =
      std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return (b - a).cross(c - a).norm() > 1e-12 * longest;
}

Bounds TriangleMesh::bounds() const {
  Bounds bounds{vertices[triangles[0][0]], vertices[triangles[0][0]]};
  for (const auto& triangle : triangles) {
    for (const std::int32_t index : triangle) {
      bounds.min = bounds.min.cwiseMin(vertices[index]);
      bounds.max = bounds.max.cwiseMax(vertices[index]);
    }
  }
  return bounds;
}

double TriangleMesh::signed_volume() const {
  const Vector3d origin = bounds().centre();  // keeps the terms small
  double sum = 0;
  for (const auto& [i, j, k] : triangles) {
    const Vector3d a = vertices[i] - origin, b = vertices[j] - origin, c = vertices[k] - origin;
    sum += a.dot(b.cross(c)) / 6;
  }
  return sum;
}

double TriangleMesh::area() const {
  double sum = 0;
  for (const auto& [i, j, k] : triangles) {
    sum += 0.5 * (vertices[j] - vertices[i]).cross(vertices[k] - vertices[i]).norm();
  }
  return sum;
}

double counted_once(const TriangleMesh& mesh) {
  const std::vector<Strip> rows = strips(mesh, 1), columns = strips(mesh, 2);
  std::vector<Crossing> crossings;
  const double slack = 1e-9 * mesh.bounds().sides()[2];  // rounding of the spans
  for (const auto& [i, j, k] : mesh.triangles) {
    const Vector3d &a = mesh.vertices[i], &b = mesh.vertices[j], &c = mesh.vertices[k];
    const auto [first_row, last_row] =
        range(rows, std::min({a[1], b[1], c[1]}), std::max({a[1], b[1], c[1]}));
    for (std::size_t row = first_row; row < last_row; ++row) {
      const double y = rows[row].position;
      const auto [low, high] = span({&a, &b, &c}, y);
      const auto [first_column, last_column] = range(columns, low - slack, high + slack);
      for (std::size_t column = first_column; column < last_column; ++column) {
        const double z = columns[column].position;
        const double of_a = side(mesh, j, k, y, z), of_b = side(mesh, k, i, y, z),
                     of_c = side(mesh, i, j, y, z);
        // A line through an edge belongs to the triangle that runs along it upwards.
        const auto left = [](double s, bool upwards) { return s > 0 || (s == 0 && upwards); };
        const bool ccw = left(of_a, j < k) && left(of_b, k < i) && left(of_c, i < j);
        const bool cw = !left(of_a, j < k) && !left(of_b, k < i) && !left(of_c, i < j);
        const double total = of_a + of_b + of_c;
        if (!(ccw || cw) || total == 0) continue;
        // Counter-clockwise seen from +x: the outward side looks to +x, where the line leaves.
        crossings.push_back({row * columns.size() + column,
                             (of_a * a[0] + of_b * b[0] + of_c * c[0]) / total, ccw ? -1 : 1});
      }
    }
  }
  std::sort(crossings.begin(), crossings.end());
  double once = 0, all = 0;
  int inside = 0;
  for (std::size_t n = 0; n + 1 < crossings.size(); ++n) {
    const Crossing &here = crossings[n], &next = crossings[n + 1];
    inside += here.change;
    if (here.line != next.line) {
      inside = 0;
    } else if (inside > 0) {
      const double box = (next.x - here.x) * rows[here.line / columns.size()].width *
                         columns[here.line % columns.size()].width;
      once += box;
      all += inside * box;
    }
  }
  return all > 0 ? once / all : 1;
}

}  // namespace uniphy
