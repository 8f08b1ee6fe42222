#pragma once

#include <cstdint>

#include "ops/kernels/laws/law.hpp"

namespace uniphy::stability {

/// The least work that a law takes out of a motion, over random states; negative where it creates
/// energy. In units of what forces and flows of that size could do, so that the sign of next to
/// nothing does not count:
///   plastic  τ(G(F), 0) : (ε(F) − ε(G(F)))  over RMS ‖τ‖ · RMS ‖ε(F)‖ of the states
///   viscous  (τ(F, C) − τ(F, 0)) : D        over RMS ‖τ(F, C)‖ · RMS ‖D‖, D = ½ (C + Cᵀ)
struct Dissipation {
  double plastic = 0, viscous = 0;
  std::int64_t plastic_state = 0, viscous_state = 0;  ///< which
};

/// `count` states: F = U Σ Vᵀ with random rotations and log Σ in [−0.3, 0.3], C in [−10, 10]/s;
/// ε = ½ log F Fᵀ. dt of 2e-4 s.
Dissipation least_dissipation(const kernels::LawDescription& law, std::int64_t count,
                              std::uint64_t seed);

/// A tenth of the stress error of the trained laws, about 1 %: less cannot be told from it. The
/// analytic laws come to −1e-14.
inline constexpr double kDissipationTolerance = 1e-3;

}  // namespace uniphy::stability
