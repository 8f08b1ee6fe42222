#include "uniphy/inference/misfit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/inference/infer_run.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

TEST(Misfit, SaysHowFarWhenAndWhere) {
  testing::ObservedScene scene;
  scene.frames = 11;
  const Observation o = testing::observe(testing::elastic_body(), scene);
  Trajectory fitted = observed_trajectory(o);
  const double size = 0.25;
  // From frame 6 on the upper third along y is off by 2 % of the size along x.
  std::int64_t off = 0;
  for (std::int64_t p = 0; p < o.particles; ++p) {
    if (o.positions(0)[3 * p + 1] < scene.motion.centre[1] + 0.05) continue;
    ++off;
    for (std::int64_t f = 6; f < o.frames; ++f) {
      fitted.x[3 * (f * o.particles + p)] += 0.02 * size;
    }
  }
  const Misfit m = misfit_of(o, fitted, 1e-3, false);
  const double root = 0.02 * std::sqrt(double(off) / double(3 * o.particles));
  EXPECT_EQ(m.root[5], 0);
  EXPECT_NEAR(m.root[6], root, 1e-12);
  EXPECT_NEAR(m.largest[6], 0.02, 1e-12);
  EXPECT_NEAR(m.over_size, root * std::sqrt(5.0 / 11), 1e-12);
  EXPECT_EQ(m.grows, 6);
  EXPECT_GE(m.allowed, 1e-3);
  EXPECT_LT(m.allowed, 2e-3);
  EXPECT_EQ(m.block[1], 2);
  EXPECT_NEAR(m.block_root, 0.02 / std::sqrt(3.0) * std::sqrt(5.0 / 11), 1e-12);
  EXPECT_THAT(misfit_place(m, o), HasSubstr("from 0.015 s on"));
  EXPECT_THAT(misfit_place(m, o), HasSubstr("high along y"));

  const testing::Scratch scratch;
  write_misfit(scratch.file("r.csv"), m);
  const std::string text = read_text_file(scratch.file("r.csv"));
  EXPECT_THAT(text, ::testing::StartsWith("time_s,root_over_size,largest_over_size\n0,0,0\n"));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 12);
  EXPECT_EQ(misfit_chart(m).series.size(), 3u);
}

TEST(Misfit, NoiseIsNoReasonForALargerForecastError) {
  testing::ObservedScene scene;
  scene.frames = 11;
  Observation o = testing::observe(testing::elastic_body(), scene);
  const Trajectory fitted = observed_trajectory(o);
  o.noise = 0.01 * 0.25;  // of the size
  const Misfit plain = misfit_of(o, fitted, 1e-3, false), moved = misfit_of(o, fitted, 1e-3, true);
  EXPECT_NEAR(plain.allowed, std::hypot(1e-3, 0.02), 1e-12);
  EXPECT_NEAR(moved.allowed, std::hypot(1e-3, 0.011), 1e-12);
  EXPECT_NEAR(moved.allowed_ahead, std::hypot(5e-3, 0.011), 1e-12);
}

TEST(Misfit, WhatIsHiddenDoesNotCount) {
  testing::ObservedScene scene;
  scene.frames = 3;
  Observation o = testing::observe(testing::elastic_body(), scene);
  Trajectory fitted = observed_trajectory(o);
  for (double& x : fitted.x) x += 1e-3;
  std::fill(o.x.begin() + 6 * o.particles, o.x.end(), std::nan(""));
  const Misfit m = misfit_of(o, fitted, 1e-3, false);
  EXPECT_NEAR(m.over_size, 1e-3 / 0.25, 1e-12);
  EXPECT_EQ(m.root[2], 0);
}

TEST(Misfit, AForecastMayMissFiveTimesAsMuchAsAFit) {
  Inference found;
  found.misfit.allowed = 1e-3;
  found.misfit.allowed_ahead = 5e-3;
  found.misfit.over_size = 0.9e-3;
  EXPECT_TRUE(explains(found));
  found.rungs.resize(2);
  found.rungs[0].kept = 1;  // of a rung that was not chosen
  found.rungs[1].rung = found.rung = Rung::numbers;
  found.rungs[1].kept = 4.9e-3;
  EXPECT_TRUE(explains(found));
  found.rungs[1].kept = 5.1e-3;
  EXPECT_FALSE(explains(found));
  found.rungs[1].kept = 0;
  found.misfit.over_size = 1.1e-3;
  EXPECT_FALSE(explains(found));
}

}  // namespace
}  // namespace uniphy
