// Divided differences to rounding at any gap, and the elementary functions they stand on.

#include "ops/kernels/spectral/spectral.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace uniphy::kernels {
namespace {

template <class T>
class Spectral : public ::testing::Test {};
using Types = ::testing::Types<float, double>;
TYPED_TEST_SUITE(Spectral, Types);

// 1e-5 … 1 apart and closer, across the switch from series to quotient.
template <class T>
std::vector<std::pair<T, T>> pairs() {
  std::vector<std::pair<T, T>> all;
  for (const double b : {0.05, 0.3, 1.0, 4.0}) {
    all.push_back({T(b), T(b)});
    for (double gap = 1e-16; gap < 30; gap *= 1.37) {
      all.push_back({T(b * (1 + gap)), T(b)});
      all.push_back({T(b), T(b * (1 + gap))});
    }
  }
  return all;
}

TYPED_TEST(Spectral, LogarithmicDividedDifference) {
  using T = TypeParam;
  for (const auto& [a, b] : pairs<T>()) {
    const long double x = a, y = b;
    // atanh keeps the digits that the quotient of logarithms loses
    const long double r = (x - y) / (x + y);
    const long double exact = r == 0 ? 1 / x : 2 * std::atanh(r) / (x - y);
    const T value = log_divided_difference(a, b, std::log(a), std::log(b));
    EXPECT_NEAR(double(value / exact), 1, 20 * double(std::numeric_limits<T>::epsilon()))
        << a << ", " << b;
    EXPECT_EQ(value, log_divided_difference(b, a, std::log(b), std::log(a)));
  }
}

TYPED_TEST(Spectral, ExponentialDividedDifference) {
  using T = TypeParam;
  for (const auto& [p, q] : pairs<T>()) {
    const T a = std::log(p), b = std::log(q);
    const long double x = a, y = b, half = (x - y) / 2;
    const long double exact = std::exp((x + y) / 2) * (half == 0 ? 1 : std::sinh(half) / half);
    const T value = exp_divided_difference(a, b, std::exp(a), std::exp(b));
    EXPECT_NEAR(double(value / exact), 1, 10 * double(std::numeric_limits<T>::epsilon()))
        << a << ", " << b;
  }
}

TYPED_TEST(Spectral, HenckyStrainSplitsIntoTraceAndDeviator) {
  using T = TypeParam;
  const Vec3<T> sigma{{T(1.5), T(0.9), T(0.4)}};
  const HenckyStrain<T> h = hencky_strain(sigma, true);
  const T eps = 8 * std::numeric_limits<T>::epsilon();
  EXPECT_NEAR(h.trace, std::log(1.5 * 0.9 * 0.4), eps);
  EXPECT_NEAR(h.deviator[0] + h.deviator[1] + h.deviator[2], 0, eps);
  double q = 0;
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(h.eps[i], std::log(double(sigma[i])), eps);
    EXPECT_NEAR(h.slope[i] * sigma[i], 1, eps);
    q += double(h.deviator[i]) * h.deviator[i];
  }
  EXPECT_NEAR(h.norm, std::sqrt(q), eps);
}

// Below 0.05 the strain is constant: the differences see only the part above the clamp.
TYPED_TEST(Spectral, DividedDifferencesKnowTheClamp) {
  using T = TypeParam;
  const Vec3<T> sigma{{T(0.8), T(0.02), T(-0.3)}};
  const HenckyStrain<T> h = hencky_strain(sigma, true);
  const double log_floor = std::log(0.05), eps = std::numeric_limits<T>::epsilon();
  EXPECT_EQ(h.slope[1], T(0));
  EXPECT_EQ(h.slope[2], T(0));
  EXPECT_NEAR(h.divided[0], (std::log(0.8) - log_floor) / 0.78, 16 * eps);
  EXPECT_NEAR(h.divided[1], (std::log(0.8) - log_floor) / 1.1, 16 * eps);
  EXPECT_EQ(h.divided[2], T(0));
}

TYPED_TEST(Spectral, InverseSumIsBounded) {
  using T = TypeParam;
  const double eps = std::numeric_limits<T>::epsilon();
  EXPECT_EQ(inverse_sum(T(1), T(1)), T(0.5));
  EXPECT_EQ(inverse_sum(T(0.5), T(-0.25)), T(4));
  EXPECT_NEAR(inverse_sum(T(0.5), T(-0.5)) * kLeastSum, 1, 2 * eps);
  EXPECT_NEAR(inverse_sum(T(0), T(-1e-9)) * kLeastSum, -1, 2 * eps);
}

// The widest lanes of this translation unit against libm.
TYPED_TEST(Spectral, VectorExponentialAndLogarithmAreAccurate) {
  using T = TypeParam;
  using V = Lanes<T>;
  constexpr int width = width_of<V>;
  alignas(64) T in[width], out[width];
  const double eps = double(std::numeric_limits<T>::epsilon());
  for (double x = -4; x < 4; x += 1e-3) {
    for (int l = 0; l < width; ++l) in[l] = T(x + 1e-5 * l);
    if constexpr (is_scalar_lane<V>) {
      out[0] = lane_exp(in[0]);
    } else {
      lane_exp(V::load_aligned(in)).store_aligned(out);
    }
    for (int l = 0; l < width; ++l) {
      EXPECT_NEAR(double(out[l]) / std::exp(double(in[l])), 1, 2 * eps) << in[l];
    }
    for (int l = 0; l < width; ++l) in[l] = T(std::exp(double(in[l])));
    if constexpr (is_scalar_lane<V>) {
      out[0] = lane_log(in[0]);
    } else {
      lane_log(V::load_aligned(in)).store_aligned(out);
    }
    for (int l = 0; l < width; ++l) {
      const double exact = std::log(double(in[l]));
      EXPECT_NEAR(double(out[l]), exact, 2 * eps * std::abs(exact)) << in[l];
    }
  }
}

}  // namespace
}  // namespace uniphy::kernels
