#include "uniphy/geometry/signed_distance.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

Vector3d octant_centre(const Vector3d& centre, const Vector3d& half, int octant) {
  return centre + 0.5 * half.cwiseProduct(Vector3d(octant & 1 ? 1 : -1, octant & 2 ? 1 : -1,
                                                   octant & 4 ? 1 : -1));
}

double cell_volume(const SignedDistance& shape, const Vector3d& centre, const Vector3d& half,
                   int depth) {
  const double full = 8 * half.prod();
  const double d = shape.distance(centre);
  const double reach = half.norm();
  if (d >= reach) return 0;
  if (d <= -reach) return full;
  if (depth == 0) {
    return full * std::clamp(0.5 - d / (2 * half[0]), 0.0, 1.0);
  }
  double sum = 0;
  for (int octant = 0; octant < 8; ++octant) {
    sum += cell_volume(shape, octant_centre(centre, half, octant), 0.5 * half, depth - 1);
  }
  return sum;
}

// The largest sign * coordinate of `axis` that the shape reaches, searched depth first in the cells
// that could still beat `best`.
void extend(const SignedDistance& shape, const Vector3d& centre, const Vector3d& half, int axis,
            double sign, double tolerance, double* best) {
  const double far = sign * centre[axis] + half[axis];
  if (far <= *best) return;
  const double d = shape.distance(centre);
  if (d > half.norm()) return;
  // The ball of radius -d is inside, so is its outermost point.
  if (d <= 0) *best = std::max(*best, sign * centre[axis] - d);
  if (half.norm() < 0.25 * tolerance) {
    *best = std::max(*best, far);
    return;
  }
  // Outer halves first: they raise `best` early and prune the rest.
  for (int pass = 0; pass < 2; ++pass) {
    for (int octant = 0; octant < 8; ++octant) {
      const bool positive = (octant >> axis) & 1;
      if ((pass == 0) != (positive == (sign > 0))) continue;
      extend(shape, octant_centre(centre, half, octant), 0.5 * half, axis, sign, tolerance, best);
    }
  }
}

}  // namespace

double SignedDistance::volume() const { return octree_volume(*this, bounds(), 7); }

double octree_volume(const SignedDistance& shape, const Bounds& bounds, int depth) {
  // A cube, or the share that the leaves count would be wrong for their short and long sides.
  const Vector3d half = Vector3d::Constant(0.5 * bounds.largest_side());
  return cell_volume(shape, bounds.centre(), half, depth);
}

Bounds tight_bounds(const SignedDistance& shape, const Bounds& loose, double tolerance) {
  Bounds tight;
  for (int axis = 0; axis < 3; ++axis) {
    double high = loose.min[axis], low = -loose.max[axis];
    extend(shape, loose.centre(), 0.5 * loose.sides(), axis, 1, tolerance, &high);
    extend(shape, loose.centre(), 0.5 * loose.sides(), axis, -1, tolerance, &low);
    tight.max[axis] = std::min(high, loose.max[axis]);
    tight.min[axis] = std::max(-low, loose.min[axis]);
  }
  return tight;
}

void check_parameter(bool ok, const char* shape, const char* parameter, double value,
                     const std::string& expected) {
  if (ok) return;
  std::ostringstream message;
  message << shape << "." << parameter << ": expected " << expected << ", found " << value;
  throw Error(message.str());
}

void check_positive(const char* shape, const char* parameter, double value) {
  check_parameter(std::isfinite(value) && value > 0, shape, parameter, value, "a positive number");
}

void check_positive(const char* shape, const char* parameter, const Vector3d& value) {
  for (int axis = 0; axis < 3; ++axis) check_positive(shape, parameter, value[axis]);
}

}  // namespace uniphy
