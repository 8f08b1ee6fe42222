#include "uniphy/geometry/shapes/ellipsoid.hpp"

#include <cmath>

namespace uniphy {

using Eigen::Vector3d;

Ellipsoid::Ellipsoid(const Vector3d& radii) : radii_(radii) {
  check_positive("ellipsoid", "radii", radii);
}

bool Ellipsoid::inside(const Vector3d& p) const {
  return p.cwiseQuotient(radii_).squaredNorm() <= 1;
}

double Ellipsoid::distance(const Vector3d& p) const {
  const Vector3d squares = radii_.cwiseAbs2();
  // On a symmetry plane the root may be the pole itself; a push of 1e-12 off the plane keeps the
  // root to its right at the price of an error of that size.
  const Vector3d y = p.cwiseAbs().cwiseMax(1e-12 * radii_.minCoeff());
  const Vector3d numerator = radii_.cwiseProduct(y);
  // s = t + min aᵢ² rather than t, for the denominators lose no digits when the root is close to
  // the last pole.
  const Vector3d excess = squares - Vector3d::Constant(squares.minCoeff());
  // F(s) = Σ (aᵢyᵢ/(s + excessᵢ))² − 1 falls and is convex to the right of its last pole, and F ≥ 0
  // at this start, so Newton's iteration rises to the root without ever passing it.
  double s = (numerator - excess).maxCoeff();
  for (int iteration = 0; iteration < 200; ++iteration) {
    const Vector3d shifted = excess + Vector3d::Constant(s);
    const Vector3d ratio = numerator.cwiseQuotient(shifted);
    const double value = ratio.squaredNorm() - 1;
    const double slope = -2 * ratio.cwiseAbs2().cwiseQuotient(shifted).sum();
    const double step = -value / slope;
    if (!(step > 1e-15 * s)) break;
    s += step;
  }
  const Vector3d nearest = squares.cwiseProduct(y).cwiseQuotient(excess + Vector3d::Constant(s));
  const double magnitude = (y - nearest).norm();
  return inside(p) ? -magnitude : magnitude;
}

double Ellipsoid::volume() const { return 4 * M_PI / 3 * radii_.prod(); }

}  // namespace uniphy
