#pragma once

#include <cstdint>
#include <vector>

#include "ops/kernels/law.hpp"
#include "uniphy/geometry/random.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// What states are drawn from.
struct DrawnStateRanges {
  double strain = 0.5;        ///< largest norm of the Hencky strain where nothing yields
  double yield_strain = 0.5;  ///< yield surfaces beyond this are not visited
  double affine_low = 0.1, affine_high = 100;  ///< norm of C, 1/s
};

/// Whether states of this branch (branch_names()) can be drawn: a yield surface beyond
/// ranges.yield_strain is out of reach.
bool branch_reachable(const kernels::LawDescription& law, int branch,
                      const DrawnStateRanges& ranges);

/// `count` states of one branch, F_proj and tau from the law itself with the time step dt (s).
/// F = U exp(ε) Vᵀ with U and V random rotations; the norm of ε is log-uniform from 1e-5 on (rest:
/// from 1e-8, and F = I, C = 0 exactly in every tenth), trial states beyond the yield surface lie
/// by a log-uniform step of 1e-5 to 0.05 past it (non_newtonian, whose stress stays outside, up to
/// ranges.strain); where both signs are allowed, 70 % are compressed; J stays in [0.6, 1.3] for
/// newtonian. C has a random direction and a log-uniform norm.
LawSamples draw_states(const kernels::LawDescription& law, double dt, int branch,
                       std::int64_t count, const DrawnStateRanges& ranges, UniformRandom& random);

}  // namespace uniphy
