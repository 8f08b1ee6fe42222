#pragma once

#include <cstddef>
#include <vector>

#include "uniphy/inference/fit.hpp"
#include "uniphy/inference/rung_fitter.hpp"

namespace uniphy {

/// The schedule that leads to best_end(). Of noisy points gradients see errors of the starts as if
/// they were of the law, the more the longer the roll-out: the last stage, where there are others,
/// only ranks what the one before has reached.
FitOptions schedule_to_ends(FitOptions options);

/// The schedule where the first frame is deformed and gradients would take that for the law's, and
/// of clouds, whose gradients take several roll-outs' time: all starts are ranked over all frames,
/// and the best of each material are the ends.
FitOptions schedule_of_starts(FitOptions options);

/// An end with what was observed, the starts of its points where its law has them.
struct SettledEnd {
  FitEnd end;
  Observation seen;
};

/// The end of a fit by gradients that least squares get furthest from: z and the initial velocity,
/// where `moves_starts` with the starts of the points, over horizons that grow (numbers of frames
/// of `seen`), of which each leaves the better half. `pull`: to where each horizon begins.
SettledEnd best_end(RungFitter& fitter, const Observation& seen, const std::vector<FitEnd>& ends,
                    const std::vector<std::ptrdiff_t>& horizons, double pull, bool moves_starts);

}  // namespace uniphy
