#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "ops/kernels/rollout/rollout.hpp"
#include "uniphy/inference/observed_motion.hpp"

namespace uniphy {

/// Rolls `state` out and calls visit(frame, x) with the positions at the first `frames` of an
/// observation; a time between two steps lies on the line between their positions, which is what
/// x ← x + Δt v says.
template <class T, class Visit>
void visit_frames(const kernels::Rollout<T>& rollout, kernels::ParticleState<T> state,
                  const ObservedSteps& steps, std::ptrdiff_t frames, const Visit& visit) {
  std::ptrdiff_t next = 0;
  std::vector<T> before, between;  // at the step that the next frame follows, and at that frame
  kernels::RunOptions<T> options;
  options.every = steps.stride;
  options.on_frame = [&](std::ptrdiff_t step, const kernels::ParticleState<T>& at) {
    for (; next < frames && steps.fraction[next] > 0 && step == steps.step[next] + 1; ++next) {
      const T share = static_cast<T>(steps.fraction[next]);
      between.resize(at.x.size());
      for (std::size_t k = 0; k < between.size(); ++k)
        between[k] = (1 - share) * before[k] + share * at.x[k];
      visit(next, std::as_const(between));
    }
    while (next < frames && step == steps.step[next] && steps.fraction[next] == 0) {
      visit(next++, at.x);
    }
    if (next < frames && step == steps.step[next]) before = at.x;
    return next < frames;
  };
  rollout.run(state, steps.last(frames), options);
}

}  // namespace uniphy
