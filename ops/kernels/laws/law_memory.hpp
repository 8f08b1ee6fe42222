#pragma once

#include "ops/kernels/simd/view.hpp"

namespace uniphy::kernels {

/// The memory of the particles on both sides of a step, one number each: before it and, where
/// wanted, after it. Absent in laws without memory; read as 0 where a law that has one gets none.
template <class T>
struct LawMemory {
  View<const T> before = {};
  View<T> after = {};
  LawMemory from(std::ptrdiff_t p) const { return {before.from(p), after.from(p)}; }
};
/// The same on the way back: dL/d(memory after) → dL/d(memory before), overwritten. They may be
/// the same memory.
template <class T>
struct LawMemoryAdjoint {
  View<const T> before = {};
  View<const T> grad_after = {};
  View<T> grad_before = {};
  LawMemoryAdjoint from(std::ptrdiff_t p) const {
    return {before.from(p), grad_after.from(p), grad_before.from(p)};
  }
};

}  // namespace uniphy::kernels
