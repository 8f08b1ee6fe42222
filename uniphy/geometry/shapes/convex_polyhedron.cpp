#include "uniphy/geometry/shapes/convex_polyhedron.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace uniphy {
namespace {

using Eigen::Vector3d;

// Sorts the corners of a planar convex polygon counterclockwise round `normal`.
void sort_round(const Vector3d& normal, std::vector<Vector3d>* corners) {
  Vector3d centre = Vector3d::Zero();
  for (const Vector3d& corner : *corners) centre += corner / static_cast<double>(corners->size());
  const Vector3d u = ((*corners)[0] - centre).normalized();
  const Vector3d v = normal.cross(u);
  std::sort(corners->begin(), corners->end(), [&](const Vector3d& a, const Vector3d& b) {
    return std::atan2((a - centre).dot(v), (a - centre).dot(u)) <
           std::atan2((b - centre).dot(v), (b - centre).dot(u));
  });
}

double segment_distance(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Vector3d edge = b - a;
  const double s = std::clamp((p - a).dot(edge) / edge.squaredNorm(), 0.0, 1.0);
  return (p - a - s * edge).norm();
}

}  // namespace

ConvexPolyhedron::ConvexPolyhedron(const std::vector<Vector3d>& corners) {
  bounds_ = {corners[0], corners[0]};
  for (const Vector3d& corner : corners) {
    bounds_.min = bounds_.min.cwiseMin(corner);
    bounds_.max = bounds_.max.cwiseMax(corner);
  }
  const double tolerance = 1e-9 * bounds_.largest_side();
  const std::size_t count = corners.size();
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = i + 1; j < count; ++j) {
      for (std::size_t k = j + 1; k < count; ++k) {
        Face face;
        face.normal = (corners[j] - corners[i]).cross(corners[k] - corners[i]).normalized();
        face.offset = face.normal.dot(corners[i]);
        if (face.offset < 0) {
          face.normal = -face.normal;
          face.offset = -face.offset;
        }
        const auto height = [&](const Vector3d& p) { return face.normal.dot(p) - face.offset; };
        const bool outermost = std::all_of(corners.begin(), corners.end(), [&](const Vector3d& p) {
          return height(p) < tolerance;
        });
        const bool known = std::any_of(faces_.begin(), faces_.end(), [&](const Face& other) {
          return other.normal.dot(face.normal) > 1 - 1e-9;
        });
        if (!outermost || known) continue;
        for (const Vector3d& corner : corners) {
          if (height(corner) > -tolerance) face.corners.push_back(corner);
        }
        sort_round(face.normal, &face.corners);
        faces_.push_back(std::move(face));
      }
    }
  }
}

double ConvexPolyhedron::face_distance(const Face& face, const Vector3d& p) {
  const std::size_t count = face.corners.size();
  double nearest_edge = std::numeric_limits<double>::infinity();
  bool over_face = true;
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d& a = face.corners[i];
    const Vector3d& b = face.corners[(i + 1) % count];
    over_face = over_face && face.normal.cross(b - a).dot(p - a) >= 0;
    nearest_edge = std::min(nearest_edge, segment_distance(p, a, b));
  }
  return over_face ? std::abs(face.normal.dot(p) - face.offset) : nearest_edge;
}

double ConvexPolyhedron::distance(const Vector3d& p) const {
  double highest = -std::numeric_limits<double>::infinity();
  for (const Face& face : faces_) highest = std::max(highest, face.normal.dot(p) - face.offset);
  if (highest <= 0) return highest;
  double nearest = std::numeric_limits<double>::infinity();
  for (const Face& face : faces_) {
    if (face.normal.dot(p) > face.offset) nearest = std::min(nearest, face_distance(face, p));
  }
  return nearest;
}

double ConvexPolyhedron::volume() const {
  double sum = 0;
  for (const Face& face : faces_) {
    for (std::size_t i = 2; i < face.corners.size(); ++i) {
      const Vector3d cross =
          (face.corners[i - 1] - face.corners[0]).cross(face.corners[i] - face.corners[0]);
      sum += face.offset * face.normal.dot(cross) / 6;
    }
  }
  return sum;
}

}  // namespace uniphy
