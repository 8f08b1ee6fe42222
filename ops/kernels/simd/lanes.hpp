#pragma once

// Kernels are templates over a lane type V: a plain float or double (one particle) or an
// xsimd::batch (one particle per lane). They are branch-free: conditions become select().
//
// Everything that the instruction set changes lives in the inline namespace UNIPHY_ISA, so that
// translation units compiled with different -m flags define different symbols and the linker can
// never hand AVX-512 code to an older CPU.

#include <cmath>
#include <cstddef>
#include <type_traits>

// GCC 12 takes the deliberately undefined operands of its AVX-512 intrinsics for a mistake.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#include <xsimd/xsimd.hpp>
#pragma GCC diagnostic pop

#include "ops/kernels/simd/view.hpp"

#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__)
#define UNIPHY_ISA isa_avx512
#elif defined(__AVX2__) && defined(__FMA__)
#define UNIPHY_ISA isa_avx2
#else
#define UNIPHY_ISA isa_baseline
#endif

#define UNIPHY_INLINE inline __attribute__((always_inline))
// For code that is large or rarely run: one copy, so that the hot loops stay small.
#define UNIPHY_NOINLINE __attribute__((noinline))

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

// The widest arithmetic type of this translation unit. Where xsimd knows no vector unit (or
// reports batches of one), a lane is the scalar itself.
#if defined(XSIMD_NO_SUPPORTED_ARCHITECTURE)
template <class T>
using Lanes = T;
#else
template <class T>
using Lanes = xsimd::batch<T>;
#endif

template <class V>
struct LaneTraits {
  using Scalar = V;
  using Mask = bool;
  static constexpr int width = 1;
};
template <class T, class A>
struct LaneTraits<xsimd::batch<T, A>> {
  using Scalar = T;
  using Mask = typename xsimd::batch<T, A>::batch_bool_type;
  static constexpr int width = static_cast<int>(xsimd::batch<T, A>::size);
};
template <class V>
using ScalarOf = typename LaneTraits<V>::Scalar;
template <class V>
using MaskOf = typename LaneTraits<V>::Mask;
template <class V>
inline constexpr int width_of = LaneTraits<V>::width;

template <class V>
inline constexpr bool is_scalar_lane = std::is_arithmetic_v<V>;

// clang-format off
template <class V> UNIPHY_INLINE V select(const MaskOf<V>& m, const V& a, const V& b) {
  if constexpr (is_scalar_lane<V>) return m ? a : b; else return xsimd::select(m, a, b);
}
template <class V> UNIPHY_INLINE V lane_sqrt(const V& a) {
  if constexpr (is_scalar_lane<V>) return std::sqrt(a); else return xsimd::sqrt(a);
}
template <class V> UNIPHY_INLINE V lane_exp(const V& a) {
  if constexpr (is_scalar_lane<V>) return std::exp(a); else return xsimd::exp(a);
}
template <class V> UNIPHY_INLINE V lane_log(const V& a) {
  if constexpr (is_scalar_lane<V>) return std::log(a); else return xsimd::log(a);
}
template <class V> UNIPHY_INLINE V lane_log1p(const V& a) {
  if constexpr (is_scalar_lane<V>) return std::log1p(a); else return xsimd::log1p(a);
}
template <class V> UNIPHY_INLINE V lane_erf(const V& a) {
  if constexpr (is_scalar_lane<V>) return std::erf(a); else return xsimd::erf(a);
}
template <class V> UNIPHY_INLINE V lane_abs(const V& a) {
  if constexpr (is_scalar_lane<V>) return std::abs(a); else return xsimd::abs(a);
}
/// lane_max and lane_min return b where either is NaN (as the x86 instructions do): a bound goes
/// first, lane_max(bound, x), so that a NaN stays one.
template <class V> UNIPHY_INLINE V lane_max(const V& a, const V& b) {
  if constexpr (is_scalar_lane<V>) return a > b ? a : b; else return xsimd::max(a, b);
}
template <class V> UNIPHY_INLINE V lane_min(const V& a, const V& b) {
  if constexpr (is_scalar_lane<V>) return a < b ? a : b; else return xsimd::min(a, b);
}
#if defined(XSIMD_WITH_AVX512F) && XSIMD_WITH_AVX512F && XSIMD_VERSION_MAJOR < 9
// xsimd 8 writes a * b + c for AVX-512: which product of a sum the compiler then fuses is its own
// choice, and another one wherever the code around it is another.
inline __m512 fused(__m512 a, __m512 b, __m512 c) { return _mm512_fmadd_ps(a, b, c); }
inline __m512d fused(__m512d a, __m512d b, __m512d c) { return _mm512_fmadd_pd(a, b, c); }
#endif
/// a * b + c, fused where the instruction set fuses. (Not `fma`: batches would find xsimd's.)
template <class V> UNIPHY_INLINE V lane_fma(const V& a, const V& b, const V& c) {
  if constexpr (is_scalar_lane<V>) {
#if defined(__FMA__)
    return std::fma(a, b, c);
#else
    return a * b + c;
#endif
  }
#if defined(XSIMD_WITH_AVX512F) && XSIMD_WITH_AVX512F && XSIMD_VERSION_MAJOR < 9
  else if constexpr (sizeof(V) == 64) return fused(a, b, c);
#endif
  else return xsimd::fma(a, b, c);
}
template <class V> UNIPHY_INLINE bool any(const MaskOf<V>& m) {
  if constexpr (is_scalar_lane<V>) return m; else return xsimd::any(m);
}
/// Sum of the lanes in a fixed order, so that the bits do not depend on the instruction order.
template <class V> UNIPHY_INLINE ScalarOf<V> lane_sum(const V& a) {
  if constexpr (is_scalar_lane<V>) return a;
  else {
    alignas(64) ScalarOf<V> buffer[width_of<V>];
    a.store_aligned(buffer);
    ScalarOf<V> sum = 0;
    for (int l = 0; l < width_of<V>; ++l) sum += buffer[l];
    return sum;
  }
}
/// The same in the order that is fastest on the instruction set.
template <class V> UNIPHY_INLINE ScalarOf<V> quick_lane_sum(const V& a) {
  if constexpr (is_scalar_lane<V>) {
    return a;
  } else {
#if XSIMD_VERSION_MAJOR >= 10
    return xsimd::reduce_add(a);
#else
    return xsimd::hadd(a);
#endif
  }
}
template <class V> UNIPHY_INLINE V cbrt_positive(const V& a) { return lane_exp(lane_log(a) * V(ScalarOf<V>(1.0 / 3.0))); }
// clang-format on

/// buffer[l] = at[l * stride] for the first min(count, width) lanes, `fill` beyond.
template <int width, class T>
UNIPHY_NOINLINE void gather_strided(const T* at, std::ptrdiff_t stride, std::ptrdiff_t count,
                                    T fill, T* buffer) {
  if (count >= width) {
    for (int l = 0; l < width; ++l) buffer[l] = at[l * stride];
  } else {
    for (int l = 0; l < width; ++l) buffer[l] = l < count ? at[l * stride] : fill;
  }
}
template <int width, class T>
UNIPHY_NOINLINE void scatter_strided(T* at, std::ptrdiff_t stride, std::ptrdiff_t count,
                                     const T* buffer, bool accumulate) {
  const std::ptrdiff_t n = count < width ? count : width;
  for (std::ptrdiff_t l = 0; l < n; ++l) {
    at[l * stride] = accumulate ? at[l * stride] + buffer[l] : buffer[l];
  }
}

/// Lanes p, p+1, ... of one component; lanes at and beyond `count` take `fill`.
template <class V, class T>
UNIPHY_INLINE V load_lanes(const View<const T>& view, std::ptrdiff_t p, std::ptrdiff_t k,
                           std::ptrdiff_t count, T fill) {
  if constexpr (is_scalar_lane<V>) {
    return count > 0 ? view(p, k) : fill;
  } else {
    constexpr int w = width_of<V>;
    const T* at = view.data + p * view.particle_stride + k * view.component_stride;
    if (count >= w && view.particle_stride == 1) return V::load_unaligned(at);
    alignas(64) T buffer[w];
    gather_strided<w>(at, view.particle_stride, count, fill, buffer);
    return V::load_aligned(buffer);
  }
}

/// Writes the first `count` lanes; with `accumulate` they are added to what is there.
template <class V, class T>
UNIPHY_INLINE void store_lanes(const View<T>& view, std::ptrdiff_t p, std::ptrdiff_t k,
                               std::ptrdiff_t count, const V& value, bool accumulate = false) {
  T* at = view.data + p * view.particle_stride + k * view.component_stride;
  if constexpr (is_scalar_lane<V>) {
    if (count > 0) *at = accumulate ? *at + value : value;
  } else {
    constexpr int w = width_of<V>;
    if (count >= w && view.particle_stride == 1) {
      (accumulate ? V::load_unaligned(at) + value : value).store_unaligned(at);
      return;
    }
    alignas(64) T buffer[w];
    value.store_aligned(buffer);
    scatter_strided<w>(at, view.particle_stride, count, buffer, accumulate);
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
