#pragma once

#include "ops/kernels/simd/lanes.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Four numbers at any address.
template <class T>
struct FourOf {
  typedef T Type __attribute__((vector_size(4 * sizeof(T)), aligned(alignof(T)), may_alias));
};

/// A square of four: row k at from[k] → column k of the rows at `to`, `stride` numbers apart.
template <class T>
UNIPHY_INLINE void transpose4(const T* const (&from)[4], T* to, std::ptrdiff_t stride) {
  using Four = typename FourOf<T>::Type;
  Four row[4];
  for (int k = 0; k < 4; ++k) row[k] = *reinterpret_cast<const Four*>(from[k]);
  const Four low01 = __builtin_shufflevector(row[0], row[1], 0, 4, 1, 5);
  const Four low23 = __builtin_shufflevector(row[2], row[3], 0, 4, 1, 5);
  const Four high01 = __builtin_shufflevector(row[0], row[1], 2, 6, 3, 7);
  const Four high23 = __builtin_shufflevector(row[2], row[3], 2, 6, 3, 7);
  const Four column[4] = {__builtin_shufflevector(low01, low23, 0, 1, 4, 5),
                          __builtin_shufflevector(low01, low23, 2, 3, 6, 7),
                          __builtin_shufflevector(high01, high23, 0, 1, 4, 5),
                          __builtin_shufflevector(high01, high23, 2, 3, 6, 7)};
  for (int k = 0; k < 4; ++k) *reinterpret_cast<Four*>(to + k * stride) = column[k];
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
