#pragma once

#include "ops/kernels/simd/lanes.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

template <class V>
struct Vec3 {
  V e[3];
  UNIPHY_INLINE V& operator[](int i) { return e[i]; }
  UNIPHY_INLINE const V& operator[](int i) const { return e[i]; }
};

/// 3×3 matrix of lanes, row-major. (Eigen's fixed matrices take SIMD packs as scalars only with
/// their own expression machinery compiled for every instruction set; these few products do not
/// need it.)
template <class V>
struct Mat3 {
  V e[9];
  UNIPHY_INLINE V& operator()(int i, int j) { return e[3 * i + j]; }
  UNIPHY_INLINE const V& operator()(int i, int j) const { return e[3 * i + j]; }
};

// clang-format off
template <class V> UNIPHY_INLINE Mat3<V> zero3() {
  Mat3<V> r; for (int k = 0; k < 9; ++k) r.e[k] = V(ScalarOf<V>(0)); return r;
}
template <class V> UNIPHY_INLINE Mat3<V> identity3() {
  Mat3<V> r = zero3<V>(); for (int k = 0; k < 9; k += 4) r.e[k] = V(ScalarOf<V>(1)); return r;
}
template <class V> UNIPHY_INLINE Mat3<V> operator+(const Mat3<V>& a, const Mat3<V>& b) {
  Mat3<V> r; for (int k = 0; k < 9; ++k) r.e[k] = a.e[k] + b.e[k]; return r;
}
template <class V> UNIPHY_INLINE Mat3<V> operator-(const Mat3<V>& a, const Mat3<V>& b) {
  Mat3<V> r; for (int k = 0; k < 9; ++k) r.e[k] = a.e[k] - b.e[k]; return r;
}
template <class V> UNIPHY_INLINE Mat3<V> operator*(const Mat3<V>& a, const V& s) {
  Mat3<V> r; for (int k = 0; k < 9; ++k) r.e[k] = a.e[k] * s; return r;
}
/// a b
template <class V> UNIPHY_INLINE Mat3<V> mul(const Mat3<V>& a, const Mat3<V>& b) {
  Mat3<V> r;
  for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j)
    r(i, j) = lane_fma(a(i, 0), b(0, j), lane_fma(a(i, 1), b(1, j), a(i, 2) * b(2, j)));
  return r;
}
/// aᵀ b
template <class V> UNIPHY_INLINE Mat3<V> tmul(const Mat3<V>& a, const Mat3<V>& b) {
  Mat3<V> r;
  for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j)
    r(i, j) = lane_fma(a(0, i), b(0, j), lane_fma(a(1, i), b(1, j), a(2, i) * b(2, j)));
  return r;
}
/// a bᵀ
template <class V> UNIPHY_INLINE Mat3<V> mult(const Mat3<V>& a, const Mat3<V>& b) {
  Mat3<V> r;
  for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j)
    r(i, j) = lane_fma(a(i, 0), b(j, 0), lane_fma(a(i, 1), b(j, 1), a(i, 2) * b(j, 2)));
  return r;
}
/// a diag(d) bᵀ
template <class V> UNIPHY_INLINE Mat3<V> compose(const Mat3<V>& a, const Vec3<V>& d, const Mat3<V>& b) {
  Mat3<V> ad;
  for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j) ad(i, j) = a(i, j) * d[j];
  return mult(ad, b);
}
template <class V> UNIPHY_INLINE Mat3<V> transpose(const Mat3<V>& a) {
  Mat3<V> r; for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j) r(i, j) = a(j, i); return r;
}
template <class V> UNIPHY_INLINE Mat3<V> sym(const Mat3<V>& a) {
  const V half(ScalarOf<V>(0.5)); Mat3<V> r;
  for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j) r(i, j) = i == j ? a(i, i) : (a(i, j) + a(j, i)) * half;
  return r;
}
template <class V> UNIPHY_INLINE V trace(const Mat3<V>& a) { return a.e[0] + a.e[4] + a.e[8]; }
/// a : b
template <class V> UNIPHY_INLINE V dot(const Mat3<V>& a, const Mat3<V>& b) {
  V s = a.e[0] * b.e[0]; for (int k = 1; k < 9; ++k) s = lane_fma(a.e[k], b.e[k], s); return s;
}
/// The matrix of cofactors, d(det a)/da = det(a) a⁻ᵀ.
template <class V> UNIPHY_INLINE Mat3<V> cofactor(const Mat3<V>& a) {
  Mat3<V> r;
  for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
    r(i, j) = a(i1, j1) * a(i2, j2) - a(i1, j2) * a(i2, j1);
  }
  return r;
}
template <class V> UNIPHY_INLINE V determinant(const Mat3<V>& a) {
  return a(0, 0) * (a(1, 1) * a(2, 2) - a(1, 2) * a(2, 1))
       - a(0, 1) * (a(1, 0) * a(2, 2) - a(1, 2) * a(2, 0))
       + a(0, 2) * (a(1, 0) * a(2, 1) - a(1, 1) * a(2, 0));
}
template <class V> UNIPHY_INLINE V sum(const Vec3<V>& a) { return a[0] + a[1] + a[2]; }
template <class V> UNIPHY_INLINE V dot(const Vec3<V>& a, const Vec3<V>& b) {
  return lane_fma(a[0], b[0], lane_fma(a[1], b[1], a[2] * b[2]));
}
template <class V> UNIPHY_INLINE Mat3<V> select3(const MaskOf<V>& m, const Mat3<V>& a, const Mat3<V>& b) {
  Mat3<V> r; for (int k = 0; k < 9; ++k) r.e[k] = select<V>(m, a.e[k], b.e[k]); return r;
}
// clang-format on

/// Missing lanes read the identity, a state that every law accepts.
template <class V, class T>
UNIPHY_INLINE Mat3<V> load_mat3(const View<const T>& view, std::ptrdiff_t p, std::ptrdiff_t count,
                                bool identity_fill) {
  Mat3<V> r;
  for (int k = 0; k < 9; ++k)
    r.e[k] = load_lanes<V, T>(view, p, k, count, T(identity_fill && k % 4 == 0));
  return r;
}
template <class V, class T>
UNIPHY_INLINE void store_mat3(const View<T>& view, std::ptrdiff_t p, std::ptrdiff_t count,
                              const Mat3<V>& value, bool accumulate = false) {
  for (int k = 0; k < 9; ++k) store_lanes<V, T>(view, p, k, count, value.e[k], accumulate);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
