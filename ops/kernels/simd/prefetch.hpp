#pragma once

#include <cstddef>

namespace uniphy::kernels {

/// Asks for memory that will be needed soon. Chunks are longer than the hardware prefetchers look
/// ahead, and their planes are no stream to them. Callers ask for what the next chunk takes a piece
/// at a time, between the parts of the work on this one: a burst of more lines than a core can miss
/// at once makes that work wait, and 1e6 particles cost a third more.
inline void prefetch(const void* from, std::size_t bytes) {
  for (std::size_t i = 0; i < bytes; i += 64) {
    __builtin_prefetch(static_cast<const char*>(from) + i, 1, 2);
  }
}

}  // namespace uniphy::kernels
