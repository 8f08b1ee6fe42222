#pragma once

#include "uniphy/geometry/random.hpp"

namespace uniphy {

/// The viscosity of a fluid as a function of its rate of shear γ̇ (1/s), Pa s:
///   η(γ̇) = η∞ + (η₀ − η∞) f(k γ̇)
///   constant  f = 1
///   power     (1 + x)ⁿ⁻¹: a power law that is finite at rest; with η∞ > 0 that of Sisko
///   cross     1/(1 + xⁿ): M. M. Cross, J. Colloid Sci. 20 (1965)
///   bingham   (1 − e⁻ˣ)/x: T. C. Papanastasiou, J. Rheol. 31 (1987), yield stress (η₀ − η∞)/k
struct ShearViscosity {
  enum class Kind { constant, power, cross, bingham };
  Kind kind = Kind::constant;
  double at_rest = 0;      ///< η₀
  double at_infinity = 0;  ///< η∞
  double time = 0;         ///< k, s
  double exponent = 1;     ///< n

  double operator()(double rate) const;
};

/// Thins or thickens from a hundredth to twice `rate` (1/s) on, which is what the states reach;
/// none at all at times.
ShearViscosity draw_viscosity(double rate, UniformRandom& random);

}  // namespace uniphy
