#pragma once

#include <cstdint>

#include "ops/kernels/laws/law.hpp"

namespace uniphy::stability {

/// The least work that a law takes out of a motion, over random states, as the cosine between
/// force and flow, in [−1, 1]; negative where it creates energy.
struct Dissipation {
  double plastic = 0;  ///< of τ(G(F), 0) and ε(F) − ε(G(F)); 1 where nothing flows
  double viscous = 0;  ///< of τ(F, C) − τ(F, 0) and D = ½ (C + Cᵀ); 1 where there is none
  std::int64_t plastic_state = 0, viscous_state = 0;  ///< which
};

/// `count` states: F = U Σ Vᵀ with random rotations and log Σ in [−0.3, 0.3], C in [−10, 10]/s;
/// ε = ½ log F Fᵀ. dt of 2e-4 s.
Dissipation least_dissipation(const kernels::LawDescription& law, std::int64_t count,
                              std::uint64_t seed);

/// What rounding leaves of a cosine that is 0, as of a fluid, whose pressure does no work on a
/// deviatoric flow.
inline constexpr double kDissipationTolerance = 1e-6;

}  // namespace uniphy::stability
