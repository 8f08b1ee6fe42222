#pragma once

#include <atomic>

namespace uniphy::kernels {

/// What every roll-out of the process calls between two of its steps, at least once in a segment of
/// its tape, from the thread that runs it; what it throws ends the roll-out. A long roll-out would
/// else not notice that its user wants to stop. Null, as at first: nothing is called.
inline std::atomic<void (*)()> between_steps{nullptr};

inline void call_between_steps() {
  if (auto* call = between_steps.load(std::memory_order_relaxed)) call();
}

}  // namespace uniphy::kernels
