#pragma once

#include <Eigen/Core>
#include <limits>

#include "uniphy/geometry/random.hpp"

namespace uniphy {

/// The norm of the deviatoric Hencky strain at which a plastic law yields, over p = apex − tr ε and
/// the Lode angle:
///   q_y = (k + slope scale ((1 + p/scale)ᵐ − 1)/m) √(1 − (p/crush)²) g
/// k alone is von Mises, k = 0 and m = 1 Drucker–Prager with cohesion `apex`; m < 1 bends the cone,
/// `crush` closes it in compression. With the unit deviator n, cos 3θ = √6 Σ nᵢ³,
///   g = 2 K/((1 + K) − (1 − K) cos 3θ),
/// K the strength in extension over that in compression: G. Gudehus (1973), J. H. Argyris et al.,
/// Comput. Methods Appl. Mech. Eng. 4 (1974); convex for K ≥ 7/9.
struct YieldCap {
  double k = 0;                                            ///< strain
  double slope = 0;                                        ///< 0: no friction
  double scale = 1;                                        ///< strain at which the cone bends
  double bend = 1;                                         ///< m
  double apex = std::numeric_limits<double>::infinity();   ///< tr ε at which it tears
  double crush = std::numeric_limits<double>::infinity();  ///< p at which it is crushed
  double lode = 1;                                         ///< K

  /// The trace that a return goes to: `trace` within [apex − crush, apex].
  double returned_trace(double trace) const;
  /// q_y at a trace within that interval; `direction` is the unit deviator.
  double radius(double trace, const Eigen::Vector3d& direction) const;
};

/// How much stress beyond the surface a rate of plastic flow takes, rate = r φ(o/s):
///   none     everything beyond the surface flows off at once
///   linear   φ = x, as in non_newtonian
///   power    ((1 + x)ⁿ − 1)/n: after P. Perzyna, Q. Appl. Math. 20 (1963), and D. Perić, Int. J.
///            Numer. Methods Eng. 36 (1993)
///   sinh     sinh x: H. Eyring, J. Chem. Phys. 4 (1936); its inverse, arsinh x, thickens
struct Overstress {
  enum class Kind { none, linear, power, sinh, arsinh };
  Kind kind = Kind::none;
  double strain = 1;    ///< s/(2 G): the overstress is 2 G (q − q_y)
  double rate = 1;      ///< r, 1/s
  double exponent = 1;  ///< n

  /// Rate (1/s) at the elastic strain `beyond` the surface, and its inverse.
  double flow(double beyond) const;
  double beyond(double flow) const;
  /// q after a step of dt (s) from the trial q beyond the radius:
  /// q' with (q − q')/dt = flow(q' − radius).
  double returned(double q, double radius, double dt) const;
};

struct RandomYield {
  YieldCap cap;
  Overstress rate;

  /// The Hencky strain after a step from the trial one.
  Eigen::Vector3d project(const Eigen::Vector3d& eps, double dt) const;
};

/// Caps around those of plasticine, sand and non_newtonian for a solid of shear modulus G and bulk
/// modulus K (Pa) whose traces reach `trace`. The cone of cohesive_sand itself is not among them:
/// what coheres also bends.
RandomYield draw_yield(double shear, double bulk, double trace, UniformRandom& random);

}  // namespace uniphy
