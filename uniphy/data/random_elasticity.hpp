#pragma once

#include <Eigen/Core>
#include <vector>

#include "uniphy/geometry/random.hpp"

namespace uniphy {

/// Stiffnesses that a law may have on its states, over those at rest.
inline constexpr double kLeastTangent = 0.05;
inline constexpr double kLargestTangent = 100;

/// One term of an isotropic elastic law: principal Kirchhoff stresses, Pa, as a function of the
/// Hencky strains ε, each with the small-strain shear modulus `modulus` = G (which may be negative
/// where others make up for it):
///   isochoric   2 G/n dev(λ̄ᵢⁿ), λ̄ᵢ = exp(ε̂ᵢ): R. W. Ogden, Proc. R. Soc. A 326 (1972)
///   whole       2 G (σᵢⁿ − 1)/n: a Seth–Hill strain measure; R. Hill, J. Mech. Phys. Solids 16
///               (1968)
///   stiffening  2 G ε̂ exp(n ‖ε̂‖²): after Y. C. Fung's exponential energies, Am. J. Physiol. 213
///               (1967)
/// In the limit n = 0 all three are linear in ε.
struct ElasticTerm {
  enum class Measure { isochoric, whole, stiffening };
  Measure measure = Measure::isochoric;
  double modulus = 0;   ///< Pa
  double exponent = 0;  ///< n
};

/// The volumetric part of the Kirchhoff stress, K (Jᵃ − Jᵇ)/(a − b), Pa; K log J where a = b = 0. K
/// is the bulk modulus at J = 1. Among them are K/2 (J² − 1), K J (J − 1), Tait's K/n J (1 − J⁻ⁿ)
/// and the κ (J − J⁻⁶) of newtonian (K = 7 κ).
struct EquationOfState {
  double modulus = 0;  ///< K
  double a = 0, b = 0;

  double stress(double log_J) const;
  /// Whether dτ/d(log J) is within kLeastTangent and kLargestTangent times K there.
  bool stable(double log_J) const;
};

/// An isotropic elastic law: terms and an equation of state.
struct RandomElasticity {
  std::vector<ElasticTerm> terms;
  EquationOfState state;

  /// Principal Kirchhoff stresses of the Hencky strains, in their order.
  Eigen::Vector3d stress(const Eigen::Vector3d& eps) const;
  double shear_modulus() const;
  /// Whether ∂τ/∂ε stays positive (Hill's condition) and of sensible size at the strains: its
  /// eigenvalues at least kLeastTangent and at most kLargestTangent times the least and the largest
  /// at rest.
  bool stable(const std::vector<Eigen::Vector3d>& strains) const;
};

/// Exponents a and b of an equation of state. `liquid` leaves out K J (J − 1), which with no
/// viscosity would be the law `water`.
EquationOfState draw_equation_of_state(double modulus, bool liquid, UniformRandom& random);

/// One to three terms that add up to the shear modulus mu, one of them negative at times, and an
/// equation of state that makes lambda the first Lame parameter at rest. Pa.
RandomElasticity draw_elasticity(double mu, double lambda, UniformRandom& random);
/// Linear in ε: the stress of plasticine, sand and non_newtonian.
RandomElasticity hencky_elasticity(double mu, double lambda);

}  // namespace uniphy
