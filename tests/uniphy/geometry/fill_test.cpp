#include "uniphy/geometry/fill.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/random.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/geometry/shapes/box.hpp"
#include "uniphy/geometry/shapes/sphere.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

template <class Function>
std::string error_of(Function function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(FillLattice, CellCentresWithTheFirstIndexSlowest) {
  const std::vector<Vector3d> points = fill_lattice(Box({0.3, 0.3, 0.3}), 6);
  ASSERT_EQ(points.size(), 216u);
  std::size_t row = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      for (int k = 0; k < 6; ++k, ++row) {
        const Vector3d expected(((i + 0.5) / 6 - 0.5) * 0.3, ((j + 0.5) / 6 - 0.5) * 0.3,
                                ((k + 0.5) / 6 - 0.5) * 0.3);
        ASSERT_LT((points[row] - expected).norm(), 1e-15);
      }
    }
  }
}

TEST(FillLattice, FillsAnOblongBoxWithCubes) {
  const std::vector<Vector3d> points = fill_lattice(Box({0.2, 0.4, 0.1}), 8);
  EXPECT_EQ(points.size(), 4u * 8 * 2);
}

TEST(FillLattice, SpacingThatDividesTheSideGainsNoCell) {
  EXPECT_EQ(fill_lattice_spacing(Box({0.3, 0.3, 0.3}), 0.1).size(), 27u);
  EXPECT_EQ(fill_lattice_spacing(Box({0.3, 0.3, 0.3}), 0.0999).size(), 64u);
}

class EveryFilling : public testing::TestWithParam<std::string> {};

TEST_P(EveryFilling, LatticeComesNearTheNumberAskedFor) {
  const SolidPtr solid = make_shape(GetParam());
  for (const std::int64_t wanted : {500, 5000}) {
    const std::vector<Vector3d> points = fill_lattice_nearest(*solid, wanted);
    // A step of one cell a side changes the number by about 3 n^(2/3).
    EXPECT_NEAR(points.size(), wanted, 3 * std::pow(wanted, 2.0 / 3)) << GetParam();
    for (const Vector3d& p : points) ASSERT_TRUE(solid->inside(p));
    // Each particle stands for its share of the volume.
    const Bounds bounds = solid->bounds();
    EXPECT_GT(bounds.sides().prod(), 0.9 * solid->volume());
  }
}

TEST_P(EveryFilling, RandomMeetsTheNumberAndRepeats) {
  const SolidPtr solid = make_shape(GetParam());
  const std::vector<Vector3d> points = fill_random(*solid, 777, 5);
  ASSERT_EQ(points.size(), 777u);
  for (const Vector3d& p : points) ASSERT_TRUE(solid->inside(p));
  EXPECT_EQ(points, fill_random(*solid, 777, 5));
  EXPECT_NE(points, fill_random(*solid, 777, 6));
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EveryFilling, testing::ValuesIn(shape_names()),
                         [](const auto& info) { return info.param; });

TEST(FillRandom, SpreadsEvenly) {
  const std::vector<Vector3d> points = fill_random(Sphere(0.5), 20000, 1);
  int octants[8] = {};
  double radius_cubed = 0;
  for (const Vector3d& p : points) {
    ++octants[(p[0] > 0) + 2 * (p[1] > 0) + 4 * (p[2] > 0)];
    radius_cubed += std::pow(p.norm() / 0.5, 3) / 20000;
  }
  for (const int count : octants) EXPECT_NEAR(count, 2500, 4 * std::sqrt(2500));
  EXPECT_NEAR(radius_cubed, 0.5, 0.01);  // uniform in the ball: (r/R)³ is uniform
}

TEST(UniformRandom, BitsAreThoseOfTheStandard) {
  // The 10000th number of std::mt19937_64 with its default seed is fixed by the standard.
  UniformRandom random(5489);
  double last = 0;
  for (int i = 0; i < 10000; ++i) last = random.unit();
  EXPECT_EQ(last, static_cast<double>(9981545732273789042ULL >> 11) * 0x1p-53);
}

TEST(UniformRandom, MappingsKeepTheirRanges) {
  UniformRandom random(1);
  double low = 1e9, high = 0;
  for (int i = 0; i < 10000; ++i) {
    const double value = random.log_between(10, 1e6);
    low = std::min(low, value);
    high = std::max(high, value);
    ASSERT_LT(random.below(7), 7u);
    ASSERT_NEAR(random.direction().norm(), 1, 1e-12);
  }
  EXPECT_GE(low, 10);
  EXPECT_LT(low, 11);
  EXPECT_LE(high, 1e6);
  EXPECT_GT(high, 9e5);
}

TEST(Fill, RefusesNumbersThatMakeNoSense) {
  const Sphere sphere(0.5);
  EXPECT_THAT(error_of([&] { fill_lattice(sphere, 0); }), HasSubstr("at least 1 particle a side"));
  EXPECT_THAT(error_of([&] { fill_lattice(sphere, 1000); }), HasSubstr("at most 10000000"));
  EXPECT_THAT(error_of([&] { fill_lattice_nearest(sphere, 0); }), HasSubstr("at least 1 particle"));
  EXPECT_THAT(error_of([&] { fill_lattice_spacing(sphere, -1); }), HasSubstr("positive spacing"));
  EXPECT_THAT(error_of([&] { fill_random(sphere, 0, 1); }), HasSubstr("found 0"));
  // One cell over a torus has its centre in the hole.
  EXPECT_THAT(error_of([&] { fill_lattice(*make_shape("torus"), 1); }), HasSubstr("finer lattice"));
}

}  // namespace
}  // namespace uniphy
