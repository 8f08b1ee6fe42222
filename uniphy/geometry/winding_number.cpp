#include "uniphy/geometry/winding_number.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace uniphy {
namespace {

using Eigen::Vector3d;

constexpr int kLeafTriangles = 8;

}  // namespace

WindingNumber::WindingNumber(const TriangleMesh& mesh, double accuracy) : accuracy_(accuracy) {
  triangles_.reserve(mesh.triangles.size());
  for (const auto& [i, j, k] : mesh.triangles) {
    triangles_.push_back({mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]});
  }
  nodes_.reserve(2 * triangles_.size() / kLeafTriangles + 1);
  build(0, static_cast<int>(triangles_.size()));
}

int WindingNumber::build(int first, int last) {
  Node node{Vector3d::Zero(), Vector3d::Zero(), 0, first, last, -1, -1};
  double area = 0;
  Vector3d low = triangles_[first].a, high = low;
  for (int t = first; t < last; ++t) {
    const Triangle& triangle = triangles_[t];
    const Vector3d normal = 0.5 * (triangle.b - triangle.a).cross(triangle.c - triangle.a);
    const Vector3d centroid = (triangle.a + triangle.b + triangle.c) / 3;
    node.area_normal += normal;
    node.centre += normal.norm() * centroid;
    area += normal.norm();
    low = low.cwiseMin(centroid);
    high = high.cwiseMax(centroid);
  }
  node.centre /= area;
  for (int t = first; t < last; ++t) {
    for (const Vector3d* corner : {&triangles_[t].a, &triangles_[t].b, &triangles_[t].c}) {
      node.radius = std::max(node.radius, (*corner - node.centre).norm());
    }
  }
  const int index = static_cast<int>(nodes_.size());
  nodes_.push_back(node);
  if (last - first > kLeafTriangles) {
    int axis = 0;
    (high - low).maxCoeff(&axis);
    const int middle = first + (last - first) / 2;
    std::nth_element(triangles_.begin() + first, triangles_.begin() + middle,
                     triangles_.begin() + last, [axis](const Triangle& s, const Triangle& t) {
                       return s.a[axis] + s.b[axis] + s.c[axis] < t.a[axis] + t.b[axis] + t.c[axis];
                     });
    const int left = build(first, middle);
    const int right = build(middle, last);
    nodes_[index].left = left;
    nodes_[index].right = right;
  }
  return index;
}

double WindingNumber::solid_angle(const Triangle& triangle, const Vector3d& p) {
  const Vector3d a = triangle.a - p, b = triangle.b - p, c = triangle.c - p;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double numerator = a.dot(b.cross(c));
  const double denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  return 2 * std::atan2(numerator, denominator);
}

double WindingNumber::operator()(const Vector3d& p) const {
  double sum = 0;
  // Depth of a median split of 2³¹ triangles is below 32; each level leaves one node waiting.
  int waiting[64];
  int count = 0;
  waiting[count++] = 0;
  while (count > 0) {
    const Node& node = nodes_[waiting[--count]];
    const Vector3d offset = node.centre - p;
    const double square = offset.squaredNorm();
    const double reach = accuracy_ * node.radius;
    if (square > reach * reach) {
      sum += offset.dot(node.area_normal) / (square * std::sqrt(square));
    } else if (node.left < 0) {
      for (int t = node.first; t < node.last; ++t) sum += solid_angle(triangles_[t], p);
    } else {
      waiting[count++] = node.left;
      waiting[count++] = node.right;
    }
  }
  return sum / (4 * M_PI);
}

double WindingNumber::exact(const Vector3d& p) const {
  double sum = 0;
  for (const Triangle& triangle : triangles_) sum += solid_angle(triangle, p);
  return sum / (4 * M_PI);
}

MeshSolid::MeshSolid(const ClosedSurface& surface)
    : winding_(surface.mesh), bounds_(surface.mesh.bounds()), volume_(surface.volume) {}

bool MeshSolid::inside(const Vector3d& p) const {
  if ((p.array() < bounds_.min.array()).any() || (p.array() > bounds_.max.array()).any()) {
    return false;
  }
  return winding_(p) > 0.5;
}

}  // namespace uniphy
