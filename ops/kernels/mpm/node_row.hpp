#pragma once

#include "ops/kernels/mpm/grid.hpp"
#include "ops/kernels/simd/lanes.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

#if defined(__AVX512F__)
inline constexpr int kNodeVectorBytes = 64;
#elif defined(__AVX__)
inline constexpr int kNodeVectorBytes = 32;
#else
inline constexpr int kNodeVectorBytes = 16;
#endif

/// The four numbers of node (i, j, k).
template <class T>
UNIPHY_INLINE T* node_at(const GridView<T>& grid, int i, int j, int k) {
  return grid.data + i * grid.layer_stride + j * grid.row_stride + k * std::ptrdiff_t(4);
}

/// Three neighbouring grid nodes of a row, 12 numbers, in as few vectors as the instruction set
/// has: one with AVX-512 and float, three SSE ones with float, … Where the vectors hold 16 numbers,
/// the last four belong to a fourth node, which every user gives the weight zero.
template <class T>
struct NodeRow {
  typedef T Vector __attribute__((vector_size(kNodeVectorBytes)));
  typedef T Unaligned
      __attribute__((vector_size(kNodeVectorBytes), aligned(alignof(T)), may_alias));
  static constexpr int kLanes = kNodeVectorBytes / static_cast<int>(sizeof(T));
  static constexpr int kParts = (12 + kLanes - 1) / kLanes;

  Vector part[kParts];

  static UNIPHY_INLINE NodeRow zero() {
    NodeRow r;
    for (int p = 0; p < kParts; ++p) r.part[p] = Vector{};
    return r;
  }
  static UNIPHY_INLINE NodeRow load(const T* at) {
    NodeRow r;
    for (int p = 0; p < kParts; ++p) {
      r.part[p] = *reinterpret_cast<const Unaligned*>(at + p * kLanes);
    }
    return r;
  }
  UNIPHY_INLINE void store(T* at) const {
    for (int p = 0; p < kParts; ++p) *reinterpret_cast<Unaligned*>(at + p * kLanes) = part[p];
  }
  /// The four numbers at `at` once for each node. Intrinsics where the compiler would go through
  /// memory and wait for the store.
  static UNIPHY_INLINE NodeRow repeat4(const T* at) {
    NodeRow r;
#if defined(__AVX512F__)
    if constexpr (kLanes == 16) {
      r.part[0] = (Vector)_mm512_maskz_broadcast_f32x4(0xffff, _mm_loadu_ps(at));
      return r;
    }
    if constexpr (kLanes == 8) {
      const Vector both = (Vector)_mm512_maskz_broadcast_f64x4(0xff, _mm256_loadu_pd(at));
      for (int p = 0; p < kParts; ++p) r.part[p] = both;
      return r;
    }
#elif defined(__AVX__)
    if constexpr (kLanes == 8) {
      const __m128 four = _mm_loadu_ps(at);
      const Vector both = (Vector)_mm256_insertf128_ps(_mm256_castps128_ps256(four), four, 1);
      for (int p = 0; p < kParts; ++p) r.part[p] = both;
      return r;
    }
#endif
    for (int p = 0; p < kParts; ++p) {
      for (int l = 0; l < kLanes; ++l) r.part[p][l] = at[(p * kLanes + l) % 4];
    }
    return r;
  }
};

// clang-format off
template <class T> UNIPHY_INLINE NodeRow<T> operator+(NodeRow<T> a, const NodeRow<T>& b) {
  for (int p = 0; p < NodeRow<T>::kParts; ++p) a.part[p] += b.part[p];
  return a;
}
template <class T> UNIPHY_INLINE NodeRow<T> operator-(NodeRow<T> a, T b) {
  for (int p = 0; p < NodeRow<T>::kParts; ++p) a.part[p] -= b;
  return a;
}
template <class T> UNIPHY_INLINE NodeRow<T> operator-(T a, const NodeRow<T>& b) {
  NodeRow<T> r;
  for (int p = 0; p < NodeRow<T>::kParts; ++p) r.part[p] = a - b.part[p];
  return r;
}
template <class T> UNIPHY_INLINE NodeRow<T> operator*(NodeRow<T> a, const NodeRow<T>& b) {
  for (int p = 0; p < NodeRow<T>::kParts; ++p) a.part[p] *= b.part[p];
  return a;
}
template <class T> UNIPHY_INLINE NodeRow<T> operator*(T a, NodeRow<T> b) {
  for (int p = 0; p < NodeRow<T>::kParts; ++p) b.part[p] *= a;
  return b;
}
/// c + a b; the compiler fuses it where the instruction set can.
template <class T> UNIPHY_INLINE NodeRow<T> lane_fma(T a, const NodeRow<T>& b, NodeRow<T> c) {
  for (int p = 0; p < NodeRow<T>::kParts; ++p) c.part[p] += a * b.part[p];
  return c;
}
template <class T> UNIPHY_INLINE NodeRow<T> lane_fma(const NodeRow<T>& a, const NodeRow<T>& b, NodeRow<T> c) {
  for (int p = 0; p < NodeRow<T>::kParts; ++p) c.part[p] += a.part[p] * b.part[p];
  return c;
}
// clang-format on

/// Sum over the three nodes: out[c] = Σ_k row[4k + c].
template <class T>
UNIPHY_INLINE void sum_nodes(const NodeRow<T>& row, T* out) {
  if constexpr (NodeRow<T>::kLanes == 16) {
    const auto all = row.part[0];
    const auto sum = __builtin_shufflevector(all, all, 0, 1, 2, 3) +
                     __builtin_shufflevector(all, all, 4, 5, 6, 7) +
                     __builtin_shufflevector(all, all, 8, 9, 10, 11);
    for (int c = 0; c < 4; ++c) out[c] = sum[c];
    return;
  }
  alignas(64) T buffer[NodeRow<T>::kParts * NodeRow<T>::kLanes];
  row.store(buffer);
  for (int c = 0; c < 4; ++c) out[c] = (buffer[c] + buffer[4 + c]) + buffer[8 + c];
}

/// Sum of the 12 numbers of the three nodes.
template <class T>
UNIPHY_INLINE T sum_all(const NodeRow<T>& row) {
  T four[4];
  sum_nodes(row, four);
  return (four[0] + four[1]) + (four[2] + four[3]);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
