#include "uniphy/report/report_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace uniphy {
namespace {

/// A block of 5 x 5 x 5 particles.
std::vector<double> block() {
  std::vector<double> x;
  for (int i = 0; i < 125; ++i) {
    for (const int k : {i % 5, i / 5 % 5, i / 25}) x.push_back(0.3 + 0.02 * k);
  }
  return x;
}

std::vector<double> everywhere(const std::array<double, 9>& F) {
  std::vector<double> all;
  for (int p = 0; p < 125; ++p) all.insert(all.end(), F.begin(), F.end());
  return all;
}

std::vector<double> moved(const std::array<double, 9>& F) {
  std::vector<double> x = block();
  for (std::size_t p = 0; p < 125; ++p) {
    const double from[] = {x[3 * p], x[3 * p + 1], x[3 * p + 2]};
    for (std::size_t k = 0; k < 3; ++k) {
      x[3 * p + k] = F[3 * k] * from[0] + F[3 * k + 1] * from[1] + F[3 * k + 2] * from[2];
    }
  }
  return x;
}

constexpr std::array<double, 9> kIdentity{1, 0, 0, 0, 1, 0, 0, 0, 1};
const std::vector<std::int32_t> kOneBody(125, 0);

TEST(PlasticStrain, IsWhatTheElasticStrainLeavesOfTheWhole) {
  // Stretched to twice the length at constant volume: ε = log 2 (1, -1/2, -1/2).
  const double s = std::sqrt(0.5);
  const std::array<double, 9> stretch{2, 0, 0, 0, s, 0, 0, 0, s};
  const PlasticStrain strain(block(), everywhere(kIdentity), kOneBody);
  for (const float value : strain.at(moved(stretch), everywhere(kIdentity))) {
    EXPECT_NEAR(value, std::log(2), 1e-5);
  }
  for (const float value : strain.at(moved(stretch), everywhere(stretch))) {
    EXPECT_NEAR(value, 0, 1e-5);
  }
}

TEST(PlasticStrain, TurnsWithTheBody) {
  const double c = std::cos(0.7), s = std::sin(0.7);
  const std::array<double, 9> turn{c, -s, 0, s, c, 0, 0, 0, 1};
  const PlasticStrain strain(block(), everywhere(kIdentity), kOneBody);
  for (const float value : strain.at(moved(turn), everywhere(turn))) EXPECT_NEAR(value, 0, 1e-5);
}

TEST(PlasticStrain, IsNotKnownOfAParticleWithoutNeighboursAround) {
  // A body of three particles.
  std::vector<std::int32_t> bodies = kOneBody;
  bodies[0] = bodies[60] = bodies[124] = 1;
  const PlasticStrain strain(block(), everywhere(kIdentity), bodies);
  const auto values = strain.at(block(), everywhere(kIdentity));
  EXPECT_TRUE(std::isnan(values[60]));
  EXPECT_FALSE(std::isnan(values[61]));
}

TEST(MotionRecorder, DropsEverySecondFrameWhereTheyBecomeTooMany) {
  MotionRecorder recorder("long", {0, 0}, 100, 2 * 10);
  for (int f = 0; f < 41; ++f) {
    const double x[] = {f / 100.0, 0, 0, 0, 0, 0}, reference[] = {0, 0, 0, 0, 0, 0};
    recorder.add(f, x, nullptr, reference);
  }
  const Motion motion = recorder.finish("rest");
  EXPECT_EQ(motion.frame_stride, 8);
  ASSERT_EQ(motion.time, (std::vector<double>{0, 8, 16, 24, 32, 40}));
  EXPECT_EQ(motion.x.size(), 6u * 6u);
  for (std::size_t f = 0; f < 6; ++f) {
    EXPECT_FLOAT_EQ(motion.x[6 * f], static_cast<float>(motion.time[f] / 100));
    EXPECT_FLOAT_EQ(motion.error[2 * f], static_cast<float>(motion.time[f] / 100));
    EXPECT_EQ(motion.error[2 * f + 1], 0);
  }
}

TEST(MotionRecorder, KeepsEverySoManyOfTooManyParticles) {
  MotionRecorder recorder("large", {0, 1, 2, 3, 4, 5, 6}, 3);
  std::vector<double> x(21);
  for (std::size_t i = 0; i < 21; ++i) x[i] = double(i);
  recorder.add(0, x.data(), nullptr, nullptr);
  const Motion motion = recorder.finish();
  EXPECT_EQ(motion.particle_stride, 3);
  EXPECT_EQ(motion.body, (std::vector<std::int32_t>{0, 3, 6}));
  EXPECT_EQ(motion.x, (std::vector<float>{0, 1, 2, 9, 10, 11, 18, 19, 20}));
}

TEST(Motion, OfCloudsIsSaidToBe) {
  Observation o;
  o.frames = 2;
  o.particles = 1;
  o.time = {0, 1};
  o.x = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  EXPECT_FALSE(motion_of("observed", o).cloud);
  o.cloud = 1;
  EXPECT_TRUE(motion_of("observed", o).cloud);
}

TEST(Motion, HasNoErrorToAMotionOfOtherParticles) {
  Trajectory a, b;
  a.frames = b.frames = 1;
  a.particles = 2;
  b.particles = 1;
  a.time = b.time = {0};
  a.body = {0, 0};
  b.body = {0};
  a.x = {0, 0, 0, 1, 1, 1};
  b.x = {0, 0, 0};
  EXPECT_TRUE(motion_of("a", a, "b", b).error.empty());
  EXPECT_EQ(motion_of("a", a, "b", b).reference, "");
  EXPECT_EQ(motion_of("a", a, "a", a).error, (std::vector<float>{0, 0}));
}

}  // namespace
}  // namespace uniphy
