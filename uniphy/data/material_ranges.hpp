#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/io/material_parameters.hpp"

namespace uniphy {

/// The intervals that the parameters of one material are drawn from, in the order of
/// kernels::kLawParameterTable; [0, 0] where the law has none.
struct MaterialRanges {
  kernels::LawId id = kernels::LawId::elastic;
  std::array<std::array<double, 2>, kernels::kFamilyParameters> interval{};

  std::string name() const { return kernels::law_name(id); }
};

/// The five materials of UniPhy (CVPR 2025, supplementary) with the ranges given there: Pa, except
/// mu of newtonian and eta of non_newtonian (Pa s) and theta (rad).
const std::vector<MaterialRanges>& default_material_ranges();

/// One point of the unit cube of parameters for each of `count` trajectories, such that every
/// parameter has exactly one of them in each of `count` equal parts of [0, 1): a Latin hypercube.
/// M. McKay, R. Beckman, W. Conover, Technometrics 21 (1979).
class LatinHypercube {
 public:
  LatinHypercube(std::int64_t count, std::uint64_t seed);
  /// The point of trajectory i; `offset` in [0, 1) per parameter is the place inside its part.
  MaterialParameters point(std::int64_t i, const MaterialParameters& offset) const;

 private:
  std::int64_t count_;
  std::array<std::vector<std::int64_t>, kernels::kFamilyParameters> part_;
};

/// Parameters at a point of the unit cube: log-uniform between the ends, theta uniform.
kernels::LawDescription material_at(const MaterialRanges& ranges, const MaterialParameters& unit);

/// The norm of the deviatoric Hencky strain at which a law yields where tr ε is `trace`:
/// τ_Y/(2μ) for plasticine and non_newtonian; for sand −α (3λ+2μ)/(2μ) trace, and 0 where trace > 0
/// (drucker_prager.hpp); infinite where nothing yields.
double yield_norm(const kernels::LawDescription& law, double trace);

/// Speed of pressure waves at rest, m/s: √((λ+2μ)/ρ) of a solid; √(7κ/ρ), κ = ⅔μ + λ, of newtonian,
/// whose pressure κ(J − J⁻⁶) has the slope 7κ at J = 1.
double wave_speed(const kernels::LawDescription& law, double density);

}  // namespace uniphy
