#pragma once

#include <array>
#include <cmath>
#include <random>

namespace uniphy::testing {

/// Row-major 3×3 matrix in float64: the arithmetic of the tests, kept apart from the kernels'.
using Matrix = std::array<double, 9>;

inline Matrix diagonal(double a, double b, double c) { return {a, 0, 0, 0, b, 0, 0, 0, c}; }
inline Matrix identity() { return diagonal(1, 1, 1); }

inline Matrix operator+(const Matrix& a, const Matrix& b) {
  Matrix r;
  for (int k = 0; k < 9; ++k) r[k] = a[k] + b[k];
  return r;
}
inline Matrix operator-(const Matrix& a, const Matrix& b) {
  Matrix r;
  for (int k = 0; k < 9; ++k) r[k] = a[k] - b[k];
  return r;
}
inline Matrix operator*(const Matrix& a, double s) {
  Matrix r;
  for (int k = 0; k < 9; ++k) r[k] = a[k] * s;
  return r;
}
inline Matrix multiply(const Matrix& a, const Matrix& b) {
  Matrix r{};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) r[3 * i + j] += a[3 * i + k] * b[3 * k + j];
    }
  }
  return r;
}
inline Matrix transposed(const Matrix& a) {
  return {a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]};
}
inline double inner(const Matrix& a, const Matrix& b) {
  double s = 0;
  for (int k = 0; k < 9; ++k) s += a[k] * b[k];
  return s;
}
inline double norm(const Matrix& a) { return std::sqrt(inner(a, a)); }
inline double det(const Matrix& a) {
  return a[0] * (a[4] * a[8] - a[5] * a[7]) - a[1] * (a[3] * a[8] - a[5] * a[6]) +
         a[2] * (a[3] * a[7] - a[4] * a[6]);
}
/// U diag(s) Vᵀ
inline Matrix composed(const Matrix& U, const Matrix& s, const Matrix& V) {
  return multiply(multiply(U, s), transposed(V));
}

inline Matrix random_matrix(std::mt19937_64& random, double scale = 1) {
  std::normal_distribution<double> normal(0, scale);
  Matrix r;
  for (double& x : r) x = normal(random);
  return r;
}
/// Uniformly distributed rotation, from a random unit quaternion.
inline Matrix random_rotation(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  double w = normal(random), x = normal(random), y = normal(random), z = normal(random);
  const double n = std::sqrt(w * w + x * x + y * y + z * z);
  w /= n, x /= n, y /= n, z /= n;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

}  // namespace uniphy::testing
