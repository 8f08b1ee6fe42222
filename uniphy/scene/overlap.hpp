#pragma once

#include <vector>

#include "uniphy/scene/body.hpp"

namespace uniphy {

/// Throws Error naming both bodies and a position where two bodies of a scene take up the same
/// space: the transfers would add their masses up, and the first step would blow them apart.
/// particles[b] are those of bodies[b]. Two bodies overlap where
///   - a particle of one lies inside the solid (shape or mesh) of the other, or
///   - both are given as particles, and at a particle of one the other's particles fill at least
///     80 % of a ball of 2.5 of their spacings (the cube root of their mean volume), or a particle
///     of one stands on a particle of the other, closer than 1e-3 spacings.
/// Bodies may touch: particles stand inside their own body, and next to a flat surface a ball is
/// half full. So overlaps thinner than half a spacing between solids, or a spacing between clouds,
/// pass unnoticed, and so do clouds thinner than four spacings that do not share particles. Of two
/// bodies that both stay in place (states of an earlier run, which may press on each other) only
/// common particles count.
void check_overlap(const std::vector<BodyDescription>& bodies,
                   const std::vector<BodyParticles>& particles);

}  // namespace uniphy
