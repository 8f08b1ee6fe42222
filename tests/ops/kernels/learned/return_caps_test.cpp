// What stays of an excess over the cap of the isotropic form.

#include "ops/kernels/learned/return_caps.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace uniphy::kernels {
namespace {

using isotropic_detail::Caps;
using isotropic_detail::KeptExcess;

KeptExcess<double> kept(double x, double v, double p, double factor = 1) {
  Caps<double> c{};
  c.viscosity = v;
  c.exponent = p;
  c.factor = factor;
  return isotropic_detail::kept_excess<double>(x, c);
}

TEST(KeptExcess, SolvesItsEquation) {
  for (const double p : {0.25, 0.6, 1.3, 4.0})
    for (const double v : {1e-3, 0.1, 1.0, 50.0, 1e4})
      for (const double x : {1e-8, 1e-3, 0.4, 3.0, 40.0})
        for (const double factor : {0.2, 5.0}) {
          const double y = kept(x, v, p, factor).value;
          EXPECT_GT(y, 0) << p << " " << v << " " << x;
          EXPECT_LE(y, x);
          const double flows = factor * std::pow((1 + v) / kFlowExcess, p - 1) * std::pow(y / v, p);
          EXPECT_NEAR((y + flows) / x, 1, 1e-12) << p << " " << v << " " << x;
        }
}

TEST(KeptExcess, OfItsUnitIsTheSameShareWhateverThePower) {
  for (const double p : {0.3, 1.0, 3.0})
    EXPECT_NEAR(kept(kFlowExcess, 0.25, p).value, 0.2 * kFlowExcess, 1e-16);
}

TEST(KeptExcess, IsAShareWhereTheRateIsLinear) {
  for (const double v : {-0.2, 0.0, 1e-4, 0.5, 7.0})
    for (const double x : {-0.3, 0.0, 0.8})
      EXPECT_NEAR(kept(x, v, 1, 1.5).value, x * (v / 1.5) / (1 + v / 1.5), 1e-15);
  // Whatever the power, below the cap and where nothing is to stay.
  EXPECT_DOUBLE_EQ(kept(-0.3, 0.5, 2).value, -0.1);
  EXPECT_DOUBLE_EQ(kept(0.4, 0, 2).value, 0);
  EXPECT_DOUBLE_EQ(kept(0.4, -0.2, 2).value, -0.1);
}

TEST(KeptExcess, HasTheDerivativesOfDifferences) {
  const double h = 1e-6;
  for (const double p : {0.4, 0.9, 1.0, 1.6, 3.0})
    for (const double v : {-0.1, 4e-4, 3e-3, 0.2, 9.0})
      for (const double x : {-0.5, 0.03, 0.7, 6.0}) {
        constexpr double kFactor = 1.7;
        const KeptExcess<double> k = kept(x, v, p, kFactor);
        const auto slope = [&](double dx, double dv, double dp, double df) {
          const auto at = [&](double s) {
            return kept(x + s * dx, v + s * dv, p + s * dp, kFactor + s * df).value;
          };
          return (at(h) - at(-h)) / (2 * h);
        };
        const auto expect = [&](double got, double want) {
          EXPECT_NEAR(got, want, 1e-7 + 1e-6 * std::abs(want)) << p << " " << v << " " << x;
        };
        expect(k.per_excess, slope(x, 0, 0, 0) / x);
        expect(k.per_viscosity * v, slope(0, v, 0, 0));
        expect(k.per_log_factor, slope(0, 0, 0, kFactor));
        if (p != 1) expect(k.per_exponent, slope(0, 0, 1, 0));
      }
}

}  // namespace
}  // namespace uniphy::kernels
