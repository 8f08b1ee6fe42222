#pragma once

#include "ops/kernels/laws/law.hpp"

namespace uniphy {

/// What a law answers to a small uniaxial motion out of rest, F = C = 0 but for one entry.
struct Stiffness {
  double wave_modulus = 0;  ///< Pa, dτ₁₁/dF₁₁, λ + 2μ for the elastic laws
  double viscosity = 0;     ///< Pa s, dτ₁₁/dC₁₁, μ for newtonian
};

/// By differences of the law's own stress, so that it serves learned laws as well: the steepest
/// secant over compressions of 1e-4, 1e-3 and 1e-2 (compressed, because sand bears no tension and
/// fluids stiffen), or the tangent under an even compression of 1e-3, whichever is larger, and
/// stretching rates of ±1/s. Compares to the closed forms
///   λ + 2μ  elastic, plasticine, sand, non_newtonian, fixed_corotated
///   7 (⅔μ + λ), viscosity μ  newtonian          λ  water
/// to within the stiffening over 1 % of compression (7 % for newtonian).
Stiffness estimate_stiffness(const kernels::LawDescription& law);

/// The largest time step (s) that is stable with room to spare:
///   Δt = safety · min( Δx/(c + 3 v), ρ Δx²/(6 η) ),   c = √(wave_modulus/ρ), η = viscosity,
/// the limits of a pressure wave (Courant) and of explicit diffusion in three dimensions. v is the
/// largest speed (m/s) that the body will have: matter that is stopped at v builds up a pressure of
/// about ρ v², and where p ~ J⁻⁷, the stiffest of the laws, the sound speed at that pressure is
/// √7 v < 3 v.
double stable_time_step(const Stiffness& stiffness, double density, double dx, double speed,
                        double safety);

/// The share of the limit that is taken by default. The benchmark scenes of the field run at 0.3 to
/// 0.4 of their Courant limit.
inline constexpr double kTimeStepSafety = 0.3;

/// Rounded down to two significant digits, so that times are short decimals.
double round_time_step(double dt);

}  // namespace uniphy
