#include "uniphy/data/material_ranges.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "uniphy/geometry/random.hpp"
#include "uniphy/scene/time_step.hpp"

namespace uniphy {
namespace {

using kernels::LawDescription;
using kernels::LawId;

std::array<double, 5> all(double u) { return {u, u, u, u, u}; }

TEST(MaterialRanges, AreThoseOfTheDocument) {
  const auto& ranges = default_material_ranges();
  ASSERT_EQ(ranges.size(), 5u);
  const LawDescription sand = material_at(ranges[3], all(0));
  EXPECT_EQ(sand.id, LawId::sand);
  EXPECT_DOUBLE_EQ(sand.mu, 2400);
  EXPECT_DOUBLE_EQ(sand.theta, 0.01);
  EXPECT_EQ(sand.tau_y, 0);
  const LawDescription top = material_at(ranges[4], all(1));
  EXPECT_EQ(top.id, LawId::non_newtonian);
  EXPECT_NEAR(top.tau_y, 2e6, 1e-6);
  EXPECT_NEAR(top.eta, 100, 1e-10);
  const LawDescription middle = material_at(ranges[0], all(0.5));
  EXPECT_NEAR(middle.mu, std::sqrt(350.0 * 2595196), 1e-6);
  EXPECT_NEAR(material_at(ranges[3], all(0.5)).theta, 0.205, 1e-15);
}

TEST(MaterialRanges, LatinHypercubeHasOnePointInEachPart) {
  constexpr std::int64_t kCount = 37;
  const LatinHypercube cube(kCount, 5);
  UniformRandom random(6);
  std::array<std::set<int>, 5> seen;
  for (std::int64_t i = 0; i < kCount; ++i) {
    const auto point = cube.point(i, all(random.unit()));
    for (std::size_t k = 0; k < 5; ++k) {
      EXPECT_GE(point[k], 0);
      EXPECT_LT(point[k], 1);
      seen[k].insert(static_cast<int>(std::floor(point[k] * kCount)));
    }
  }
  for (const auto& parts : seen) EXPECT_EQ(parts.size(), static_cast<std::size_t>(kCount));
  // Each parameter has an order of its own: on average one of the points is on the diagonal.
  int diagonal = 0;
  for (std::int64_t i = 0; i < kCount; ++i) {
    const auto point = cube.point(i, all(0.5));
    diagonal += point[0] == point[1] ? 1 : 0;
  }
  EXPECT_LT(diagonal, 8);
}

// The yield surface that steers motions and sampling is the one of the kernels.
TEST(MaterialRanges, YieldNormIsWhereTheKernelYields) {
  UniformRandom random(11);
  for (const std::size_t which : {2u, 3u, 4u}) {
    for (int trial = 0; trial < 50; ++trial) {
      LawDescription law =
          material_at(default_material_ranges()[which],
                      {random.unit(), random.unit(), random.unit(), random.unit(), random.unit()});
      const double trace = -0.1 * random.unit();
      const double k = yield_norm(law, trace);
      if (k > 1) continue;
      const auto kernel = kernels::make_law<double>(law);
      for (const double q : {k * (1 - 1e-6), k * (1 + 1e-6)}) {
        // ε = q (1, −1, 0)/√2 + trace/3
        const double d = q / std::sqrt(2.0);
        const double F[9] = {std::exp(d + trace / 3), 0, 0, 0, std::exp(-d + trace / 3), 0, 0, 0,
                             std::exp(trace / 3)};
        const double C[9] = {};
        double F_proj[9], tau[9];
        kernel->evaluate(1, 1e-4, {F, 9, 1}, {C, 9, 1}, {F_proj, 9, 1}, {tau, 9, 1});
        bool changed = false;
        for (int i = 0; i < 9; ++i) changed = changed || F[i] != F_proj[i];
        EXPECT_EQ(changed, q > k) << law_name(law.id) << " mu " << law.mu << " trace " << trace;
      }
    }
  }
}

TEST(MaterialRanges, WaveSpeedIsThatOfTheLaw) {
  for (const MaterialRanges& ranges : default_material_ranges()) {
    LawDescription law = material_at(ranges, all(0.4));
    law.tau_y = law.id == LawId::plasticine || law.id == LawId::non_newtonian ? 1e6 : 0;
    if (law.id == LawId::sand) law.theta = 1.0;  // bears the compression without sliding
    const double expected = std::sqrt(estimate_stiffness(law).wave_modulus / 800);
    EXPECT_NEAR(wave_speed(law, 800), expected, 0.05 * expected) << ranges.name();
  }
}

}  // namespace
}  // namespace uniphy
