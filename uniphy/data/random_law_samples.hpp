#pragma once

#include <cstdint>

#include "uniphy/data/random_law.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// A law and what it answers.
struct RandomLawSamples {
  RandomLaw law;
  LawSamples samples;
};

/// Draws a law of this kind and answers with it as many states as `states` has, made from those of
/// a trajectory of `material`, with dt s a step:
///   solid    of elastic: ε of all states times one factor, for solids both soft and stiff
///   fluid    of newtonian: log J and C times one factor each, log J of half the states spread over
///            what it reaches; F = (I + Δt C) times a multiple of I
///   plastic  of a plastic one: tr ε times one factor (of sand: counted from the apex), the
///            deviator along its own direction on either side of the new surface: half of the
///            states beyond it by what a rate of flow leads to in a step
/// Moduli and viscosities are log-uniform over the ranges of the five families. A law whose tangent
/// does not stay positive on its states is drawn again. All samples count as drawn. Always the same
/// for the same arguments. Throws Error where no law is found.
RandomLawSamples draw_random_law(RandomLawKind kind, const LawSamples& states,
                                 const std::string& material, double dt, std::uint64_t seed);

}  // namespace uniphy
