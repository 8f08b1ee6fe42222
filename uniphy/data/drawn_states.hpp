#pragma once

#include <cstdint>

#include "ops/kernels/laws/law.hpp"
#include "uniphy/geometry/random.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// What states are drawn from.
struct DrawnStateRanges {
  double strain = 0.5;        ///< largest norm of the Hencky strain where nothing yields
  double yield_strain = 0.5;  ///< yield surfaces beyond this are not visited
  double step = 0.01;         ///< largest step of a trial strain past the yield surface
  double stress = 1e30;       ///< largest norm of tau, Pa (what yields may have more)
  double affine_low = 0.1, affine_high = 100;  ///< norm of C, 1/s
};

/// Whether states of this branch (branch_names()) can be drawn: a yield surface may be out of
/// reach, or its neighbourhood wider than one step leads past it.
bool branch_reachable(const kernels::LawDescription& law, double dt, int branch,
                      const DrawnStateRanges& ranges);

/// `count` states of one branch, F_proj and tau from the law itself with the time step dt (s).
/// F = U exp(ε) Vᵀ with random rotations U and V; the norm of ε is log-uniform from 1e-5 on (rest:
/// from 1e-8, and F = I, C = 0 exactly in every tenth), 70 % are compressed where both signs are
/// possible. C has a random direction and a log-uniform norm. As in a simulation, trial states lie
/// past the yield surface by a log-uniform step from 1e-5 to ranges.step; the stress of
/// non_newtonian stays outside, where its steps add up to ranges.step (1 + η/(2μΔt)). For
/// newtonian, which forgets everything but J, F = (I + Δt C) times a multiple of I, J in
/// [0.6, 1.3]. A state whose stress is beyond ranges.stress is drawn again from smaller strains.
LawSamples draw_states(const kernels::LawDescription& law, double dt, int branch,
                       std::int64_t count, const DrawnStateRanges& ranges, UniformRandom& random);

}  // namespace uniphy
