#pragma once

#include <array>
#include <string>

#include "uniphy/data/random_elasticity.hpp"
#include "uniphy/data/random_viscosity.hpp"
#include "uniphy/data/random_yield.hpp"

namespace uniphy {

/// The kinds of laws that are drawn at random around the five families.
enum class RandomLawKind { solid, fluid, plastic };
inline constexpr std::array<RandomLawKind, 3> kRandomLawKinds{
    RandomLawKind::solid, RandomLawKind::fluid, RandomLawKind::plastic};

/// "random_solid", "random_fluid", "random_plastic": their materials in dataset.h5 and model.h5.
const char* random_law_name(RandomLawKind kind);
/// Whether a material of a data set or a model is one of these, which name nothing that a user
/// could ask for.
bool is_random_law(const std::string& material);

/// A law drawn at random: isotropic, without memory, for training alone.
///   solid    F_proj = F; the stress of `elasticity`
///   fluid    F_proj = J^{1/3} I, J at least 1e-6; the pressure of `elasticity.state` and 2 η(γ̇)
///            times the rate D = sym C, whole or deviatoric, γ̇ = √(2 dev D : dev D)
///   plastic  F_proj = U exp(ε') Vᵀ, ε' = yield.project(ε); the stress of `elasticity`
/// ε = log max(σ, 0.05) as in the five laws.
struct RandomLaw {
  RandomLawKind kind = RandomLawKind::solid;
  RandomElasticity elasticity;
  ShearViscosity viscosity;  ///< fluid
  bool whole_rate = false;   ///< fluid: the viscous stress has a volumetric part
  RandomYield yield;         ///< plastic

  /// F, C → F_proj, tau of one state: row-major 3×3; dt in s, C in 1/s, tau in Pa.
  void evaluate(double dt, const double* F, const double* C, double* F_proj, double* tau) const;
};

}  // namespace uniphy
