#include "uniphy/data/random_viscosity.hpp"

#include <cmath>

namespace uniphy {

double ShearViscosity::operator()(double rate) const {
  const double x = time * rate;
  double f = 1;
  if (kind == Kind::power) f = std::pow(1 + x, exponent - 1);
  if (kind == Kind::cross) f = 1 / (1 + std::pow(x, exponent));
  if (kind == Kind::bingham) f = x > 0 ? -std::expm1(-x) / x : 1;
  return at_infinity + (at_rest - at_infinity) * f;
}

ShearViscosity draw_viscosity(double rate, UniformRandom& random) {
  ShearViscosity v;
  const double kind = random.unit();
  if (kind < 0.2) return v;  // inviscid
  // The stress of newtonian is mu D with mu from 50 to 1000 Pa s, and here it is 2 η D.
  v.at_rest = random.log_between(5, 1000);
  v.at_infinity = v.at_rest;
  if (kind < 0.4) return v;
  v.time = 1 / (rate * random.log_between(0.01, 2));
  if (kind < 0.65) {
    v.kind = ShearViscosity::Kind::power;
    v.exponent = random.between(0.2, 1.8);
    v.at_infinity = random.unit() < 0.5 ? 0 : v.at_rest * random.log_between(0.01, 0.5);
    return v;
  }
  v.kind = kind < 0.85 ? ShearViscosity::Kind::cross : ShearViscosity::Kind::bingham;
  v.exponent = random.between(0.5, 1.5);
  const bool thickens = random.unit() < 0.25;
  v.at_infinity =
      v.at_rest * (thickens ? random.log_between(1.5, 20) : random.log_between(0.003, 0.7));
  return v;
}

}  // namespace uniphy
