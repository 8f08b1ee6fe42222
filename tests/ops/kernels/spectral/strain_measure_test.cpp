// The family of strain measures against its closed form in long double, and its derivatives against
// central differences.

#include "ops/kernels/spectral/strain_measure.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace uniphy::kernels {
namespace {

long double closed_form(long double x, long double gamma, long double delta) {
  const long double y = gamma * x;
  const long double ratio = y == 0 ? 1 : std::sinh(y) / y;
  return x * std::exp(delta * x) * ratio;
}

TEST(StrainMeasure, FollowsItsClosedFormAtEveryArgument) {
  for (const double x : {0.0, 1e-9, -1e-4, 0.01, -0.2, 0.6, -1.5, 3.0})
    for (const double gamma : {0.0, 1e-6, 0.3, -1.0, 3.5})
      for (const double delta : {0.0, 1.0, -2.5}) {
        const auto m = strain_measure<double>(x, gamma, delta);
        const long double expected = closed_form(x, gamma, delta);
        EXPECT_NEAR(m.value, double(expected), 4e-15 * std::abs(double(expected)))
            << x << " " << gamma << " " << delta;
        const auto narrow = strain_measure<float>(float(x), float(gamma), float(delta));
        EXPECT_NEAR(narrow.value, double(expected), 3e-6 * std::abs(double(expected)));
      }
}

TEST(StrainMeasure, DerivativesMatchCentralDifferences) {
  const auto difference = [](const auto& f, double h) {
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
  };
  for (const double x : {1e-4, -0.13, 0.7, -2.0})
    for (const double gamma : {1e-3, 0.49 / 0.7, -1.0, 3.5})
      for (const double delta : {0.0, 1.0, -2.5}) {
        const auto m = strain_measure<double>(x, gamma, delta);
        const double scale = std::abs(m.value) + std::abs(m.slope) * 1e-3;
        const auto value = [&](double dx, double dg, double dd) {
          return double(closed_form(x + dx, gamma + dg, delta + dd));
        };
        EXPECT_NEAR(m.slope, difference([&](double s) { return value(s, 0, 0); }, 1e-5),
                    1e-9 * std::abs(m.slope));
        EXPECT_NEAR(m.per_gamma, difference([&](double s) { return value(0, s, 0); }, 1e-3),
                    1e-11 * scale);
        EXPECT_NEAR(m.per_delta, difference([&](double s) { return value(0, 0, s); }, 1e-3),
                    2e-11 * scale);
      }
}

TEST(StrainMeasure, KnowsHenckyGreenAndTheLiquid) {
  for (const double x : {-0.4, 1e-7, 0.3}) {
    EXPECT_DOUBLE_EQ(strain_measure<double>(x, 0, 0).value, x);
    EXPECT_NEAR(strain_measure<double>(x, 1, 1).value, std::expm1(2 * x) / 2, 1e-15);
    const double J = std::exp(x);
    EXPECT_NEAR(strain_measure<double>(x, 3.5, -2.5).value, (J - std::pow(J, -6)) / 7, 1e-14);
  }
}

TEST(StrainMeasure, DividedDifferenceReachesTheDerivative) {
  for (const double n : {0.0, 1.3, 2.0, -4.0}) {
    EXPECT_NEAR(seth_hill_divided_difference<double>(0.2, 0.2, n), std::exp(0.2 * n), 1e-15);
    const double far = seth_hill_divided_difference<double>(0.5, -0.3, n);
    const auto measure = [n](double x) { return strain_measure<double>(x, n / 2, n / 2).value; };
    EXPECT_NEAR(far, (measure(0.5) - measure(-0.3)) / 0.8, 2e-15);
  }
}

TEST(StrainMeasure, StaysFiniteInFloat) {
  for (const float x : {-9.0F, -60.0F, 60.0F}) {
    const auto m = strain_measure<float>(x, 4, -4);
    for (const float v : {m.value, m.slope, m.per_gamma, m.per_delta})
      EXPECT_TRUE(std::isfinite(v));
    EXPECT_TRUE(std::isfinite(seth_hill_divided_difference<float>(x, 0.1F, 4)));
  }
}

}  // namespace
}  // namespace uniphy::kernels
