// Clouds without correspondence: what they are compared by, the velocity from them, and a fit.

#include "uniphy/inference/cloud_comparison.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "ops/base/torch.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/inference/quick_fit.hpp"
#include "uniphy/data/laboratory_view.hpp"
#include "uniphy/inference/cloud_misses.hpp"
#include "uniphy/inference/cloud_motion.hpp"
#include "uniphy/inference/observed_noise.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

Observation clouds_of(const Observation& whole, std::int64_t points, double noise = 0) {
  LaboratoryView view;
  view.cloud = points;
  view.noise = noise;
  return laboratory_view(whole, view);
}

Tensor particles_at(const Observation& whole, std::int64_t frames) {
  return torch::tensor(
             std::vector<double>(whole.x.begin(), whole.x.begin() + frames * 3 * whole.particles),
             torch::kFloat64)
      .view({frames, whole.particles, 3});
}

class ByDistance : public ::testing::TestWithParam<const char*> {};

TEST_P(ByDistance, TheParticlesThemselvesAreNoDistanceAway) {
  const Observation whole = testing::observe(testing::elastic_body());
  Observation seen = clouds_of(whole, whole.particles);
  seen.cloud_distance = GetParam();
  const CloudComparison comparison(seen, CloudDetail::all);
  const Tensor r = comparison.residuals(particles_at(whole, 5));
  ASSERT_EQ(r.size(0), 5);
  ASSERT_EQ(r.size(1), comparison.columns());
  EXPECT_EQ(comparison.seen_per_frame(), comparison.columns());
  EXPECT_LT(r.abs().max().item<double>(), 1e-10);
}

TEST_P(ByDistance, FramesWithoutAPointDoNotCount) {
  const Observation whole = testing::observe(testing::elastic_body());
  Observation seen = clouds_of(whole, 100);
  seen.cloud_distance = GetParam();
  std::fill_n(seen.x.begin() + 3 * 100 * 2, 3 * 100, std::nan(""));
  const CloudComparison comparison(seen, CloudDetail::all);
  EXPECT_NEAR(comparison.seen_per_frame(), comparison.columns() * 40.0 / 41, 1e-9);
  const Tensor r = comparison.residuals(particles_at(whole, 4) + 0.01);
  EXPECT_EQ(r[2].abs().max().item<double>(), 0);
  EXPECT_GT(r[3].abs().max().item<double>(), 0);
}

INSTANTIATE_TEST_SUITE_P(Distances, ByDistance,
                         ::testing::Values("nearest", "chamfer", "transport"));

TEST(CloudComparison, ResidualsOfTransportAreHowFarTheBodyIsOff) {
  const Observation whole = testing::observe(testing::elastic_body());
  const CloudComparison comparison(clouds_of(whole, whole.particles), CloudDetail::all);
  const Tensor shift = torch::tensor({0.01, -0.02, 0.005}, torch::kFloat64);
  const Tensor r = comparison.residuals(particles_at(whole, 3) + shift).view({3, -1, 3});
  EXPECT_LT((r - shift).abs().max().item<double>(), 2e-3);
  // Iterations are few: the mean comes to 1 % of the shift.
  EXPECT_LT((r.mean(1) - shift).abs().max().item<double>(), 2e-4);
}

TEST(CloudComparison, ARoughOneIsOfAPart) {
  testing::ObservedScene scene;
  scene.side = 8;
  scene.frames = 3;
  const Observation whole = testing::observe(testing::elastic_body(), scene);
  const CloudComparison rough(clouds_of(whole, 400), CloudDetail::rough);
  EXPECT_EQ(rough.columns(), 3 * kRoughCloudPoints);
  const Tensor near = rough.residuals(particles_at(whole, 3)),
               off = rough.residuals(particles_at(whole, 3) + 0.05);
  EXPECT_LT(near.square().mean().item<double>(), 0.1 * off.square().mean().item<double>());
}

TEST(CloudNoise, IsWhatACloudLeavesOfTheBodyInItsPlace) {
  const Observation whole = testing::observe(testing::elastic_body());
  EXPECT_LT(cloud_noise(clouds_of(whole, whole.particles)), 1e-10);
  const double part = cloud_noise(clouds_of(whole, 100));
  EXPECT_GT(part, 1e-3);  // of a spacing of 0.05 m
  EXPECT_LT(part, 0.05);
  EXPECT_EQ(observed_noise(clouds_of(whole, 100)), part);
  Observation empty = clouds_of(whole, 100);
  std::fill_n(empty.x.begin(), 3 * 100, std::nan(""));
  EXPECT_NEAR(cloud_noise(empty), 0.025, 1e-9);  // half the spacing
}

TEST(CloudMotion, TheVelocityOfTheBodyIsFound) {
  testing::ObservedScene scene;
  scene.motion.centre = {0.5, 0.6, 0.5};
  const Observation seen = clouds_of(testing::observe(testing::elastic_body(), scene), 108, 0.005);
  const MotionEstimate found =
      estimate_cloud_motion(seen, observed_steps(seen, "o"), observed_grid(seen, "o"));
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(found.motion.linear[k], scene.motion.linear[k], 4 * found.spread[k]);
    EXPECT_NEAR(found.motion.angular[k], scene.motion.angular[k], 4 * found.spread[3 + k]);
    EXPECT_LT(found.spread[k], 0.3);
    EXPECT_LT(found.spread[3 + k], 3);
  }
  EXPECT_GT(first_contact(seen, observed_steps(seen, "o"), observed_grid(seen, "o"), found.motion),
            10);
}

TEST(Clouds, TheLawOfABodyIsFoundFromThem) {
  testing::ObservedScene scene;
  scene.side = 5;
  scene.grid = 12;
  scene.frames = 61;
  scene.every = 5;
  scene.motion = {{0.5, 0.44, 0.5}, {0.4, -2.5, -0.3}, {1.0, -2.0, 3.0}};
  const Observation seen = clouds_of(testing::observe(testing::elastic_body(), scene), 125, 0.005);
  const Inference found = testing::quick_elastic_fit(seen);
  EXPECT_TRUE(found.explained);
  EXPECT_EQ(found.fitted.particles, 125);
  EXPECT_NEAR(found.fit.law.mu, 2e4, 0.1 * 2e4);
  EXPECT_LT((found.fit.motion.linear - scene.motion.linear).norm(), 0.05);
}

}  // namespace
}  // namespace uniphy
