#include "uniphy/geometry/shapes/toy.hpp"

#include <algorithm>
#include <cmath>

#include "uniphy/geometry/smooth_union.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

double ball(const Vector3d& p, const Vector3d& centre, double radius) {
  return (p - centre).norm() - radius;
}

double capsule(const Vector3d& p, const Vector3d& a, const Vector3d& b, double radius) {
  const Vector3d axis = b - a;
  const double s = std::clamp((p - a).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (p - a - s * axis).norm() - radius;
}

}  // namespace

Toy::Toy(double fillet) : fillet_(fillet) {
  check_parameter(fillet >= 0 && fillet <= 0.2, "toy", "fillet", fillet, "a number from 0 to 0.2");
  const Bounds loose{{-0.6, -0.2, -0.6}, {0.6, 1.2, 0.6}};
  bounds_ = tight_bounds(*this, loose, 1e-3);
}

double Toy::distance(const Vector3d& q) const {
  const Vector3d p(std::abs(q[0]), q[1], q[2]);                     // mirror symmetry
  double d = capsule(p, {0, 0.33, 0}, {0, 0.42, 0}, 0.19);          // trunk
  d = smooth_union(d, ball(p, {0, 0.75, 0.01}, 0.175), fillet_);    // head
  d = smooth_union(d, ball(p, {0.135, 0.905, 0}, 0.075), fillet_);  // ears
  d = smooth_union(d, ball(p, {0, 0.71, 0.165}, 0.075), fillet_);   // snout
  d = smooth_union(d, capsule(p, {0.16, 0.52, 0.02}, {0.35, 0.42, 0.1}, 0.075), fillet_);    // arms
  d = smooth_union(d, capsule(p, {0.13, 0.2, 0.02}, {0.18, 0.09, 0.06}, 0.095), fillet_);    // legs
  return smooth_union(d, capsule(p, {0.19, 0.08, 0.08}, {0.2, 0.08, 0.15}, 0.08), fillet_);  // feet
}

}  // namespace uniphy
