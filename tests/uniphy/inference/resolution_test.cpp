#include "uniphy/inference/resolution.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

Observation seen() {
  testing::ObservedScene scene;
  scene.frames = 3;
  return testing::observe(testing::elastic_body(), scene);  // a grid of 16, walls at 2/16
}

double volume_of(const Observation& o) {
  return std::accumulate(o.volume.begin(), o.volume.end(), 0.0);
}

TEST(Resolution, AnotherGridFillsTheBodyAnewAndLeavesTheWalls) {
  std::vector<std::string> warnings;
  const Observation from = seen();
  Resolution fine;
  fine.grid = 32;
  const Observation o = at_resolution(from, fine, "o", warnings);
  EXPECT_EQ(o.grid, 32);
  EXPECT_EQ(o.bound, 5);  // (5 − 1)/32 = (3 − 1)/16
  EXPECT_NEAR(o.dt, from.dt / 2, 1e-15);
  EXPECT_TRUE(o.tracked());
  EXPECT_EQ(o.points(), from.particles);
  EXPECT_EQ(o.x, from.x);
  EXPECT_NEAR(volume_of(o), volume_of(from), 1e-12);
  // 8 particles a cell, but for edges that are rounded.
  const double full = 8 * volume_of(from) * 32 * 32 * 32;
  EXPECT_LE(double(o.particles), 1.05 * full);
  EXPECT_GE(double(o.particles), 0.8 * full);
  EXPECT_TRUE(warnings.empty());
}

TEST(Resolution, TheSameGridChangesNothing) {
  std::vector<std::string> warnings;
  const Observation from = seen();
  Resolution same;
  same.grid = 16;
  same.dt = 1e-4;
  const Observation o = at_resolution(from, same, "o", warnings);
  EXPECT_FALSE(o.tracked());
  EXPECT_EQ(o.dt, 1e-4);
  EXPECT_EQ(o.particles, from.particles);
}

TEST(Resolution, AGridWithoutNodesAtTheWallsIsRefused) {
  std::vector<std::string> warnings;
  Resolution odd;
  odd.grid = 20;
  EXPECT_THAT(testing::error_of([&] { at_resolution(seen(), odd, "seen.h5", warnings); }),
              HasSubstr("seen.h5: resolution.grid: expected a grid that has nodes where the walls "
                        "stand, 2 / 16 of the side, found 20"));
}

TEST(Resolution, ASurfaceIsFilled) {
  Observation o = seen();
  const double low = 0.35, high = 0.65;
  for (int v = 0; v < 8; ++v) {
    for (const int bit : {v & 1, v >> 1 & 1, v >> 2 & 1}) o.vertices.push_back(bit ? high : low);
  }
  o.triangles = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  o.tracers.assign(o.x.begin(), o.x.begin() + 3 * o.particles);
  o.particles = 0;
  o.volume.clear();
  const testing::Scratch scratch;
  write_observation(scratch.file("o.h5"), o);  // and through the file
  std::vector<std::string> warnings;
  const Observation filled =
      at_resolution(read_observation(scratch.file("o.h5")), {}, "o", warnings);
  EXPECT_NEAR(volume_of(filled), 0.027, 1e-6);
  EXPECT_EQ(filled.particles, 10 * 10 * 10);  // 0.3 m in spacings of at most 1/32
  o.triangles.resize(6);
  EXPECT_THAT(testing::error_of([&] { at_resolution(o, {}, "seen.h5", warnings); }),
              HasSubstr("seen.h5: /body"));
}

}  // namespace
}  // namespace uniphy
