#include "uniphy/evaluation/rollout_error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "tests/support/on_threads.hpp"
#include "tests/support/random_weights.hpp"
#include "tests/uniphy/evaluation/small_run.hpp"
#include "uniphy/data/generate.hpp"
#include "uniphy/evaluation/law_cost.hpp"
#include "uniphy/scene/comparison.hpp"

namespace uniphy {
namespace {

std::vector<TrajectorySetup> setups() {
  const GenerateOptions options = testing::small_set();
  std::vector<TrajectorySetup> all;
  for (std::int64_t i = 0; i < options.total(); ++i) all.push_back(draw_setup(options, i, 0));
  return all;
}

std::vector<kernels::LawDescription> own_laws(const std::vector<TrajectorySetup>& of) {
  std::vector<kernels::LawDescription> laws;
  for (const TrajectorySetup& setup : of) laws.push_back(setup.law());
  return laws;
}

TEST(RolloutError, IsZeroWithTheLawItselfAndNotWithAnother) {
  const auto all = setups();
  ASSERT_EQ(all.size(), 5u);
  auto laws = own_laws(all);
  laws[0].mu *= 1.2;
  laws[0].lambda *= 1.2;
  const auto errors = rollout_errors(all, laws);
  for (std::size_t i = 1; i < errors.size(); ++i) {
    EXPECT_EQ(errors[i].root_over_size, 0) << all[i].record.material;
    EXPECT_EQ(errors[i].failure, "");
  }
  // By the definition: the root of position_mse over the largest side, all frames from the first.
  const TrajectoryComparison whole = compare_trajectories(
      roll_out(all[0], laws[0]), roll_out(all[0], all[0].law()), FrameMatch::all);
  EXPECT_EQ(whole.time.size(), 13u);  // 60 steps, every 5th and the first
  EXPECT_GT(errors[0].root_over_size, 0);
  EXPECT_EQ(errors[0].root_over_size, std::sqrt(whole.position_mse) / whole.size);
}

TEST(RolloutError, AFailureIsInfiniteAndSaysWhy) {
  const auto all = setups();
  auto laws = own_laws(all);
  laws[2].id = kernels::LawId::learned;
  laws[2].weights = std::make_shared<kernels::LearnedLawWeights>(
      testing::random_weights(kernels::LawForm::published, 4, 8, 1, kernels::Activation::silu, 5));
  laws[2].z = {5, 0, 0, 0};  // 1e10 Pa at rest
  const auto errors = rollout_errors(all, laws);
  EXPECT_TRUE(std::isinf(errors[2].root_over_size));
  EXPECT_THAT(errors[2].failure, ::testing::HasSubstr("particle"));
  EXPECT_EQ(errors[1].failure, "");
  // The truth must not fail.
  auto broken = all;
  broken[1].scene.bodies.front().law.mu = -1;
  EXPECT_THAT(testing::error_of([&] { rollout_errors(broken, own_laws(all)); }),
              ::testing::HasSubstr("mu"));
}

TEST(RolloutError, SameBitsOnOneThreadAndTwo) {
  const auto all = setups();
  auto laws = own_laws(all);
  for (kernels::LawDescription& law : laws) law.lambda *= 1.1;
  const auto errors = [&] { return rollout_errors(all, laws); };
  const auto one = testing::on_threads(1, errors), two = testing::on_threads(2, errors);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_GT(one[i].root_over_size, 0);
    EXPECT_EQ(one[i].root_over_size, two[i].root_over_size);
  }
}

TEST(RolloutError, CodesMakeLaws) {
  const auto weights = std::make_shared<const kernels::LearnedLawWeights>();
  EXPECT_TRUE(learned_laws(weights, {}).empty());
  auto two = std::make_shared<kernels::LearnedLawWeights>();
  two->latent_size = 2;
  const auto laws = learned_laws(two, {1, 2, 3, 4});
  ASSERT_EQ(laws.size(), 2u);
  EXPECT_EQ(laws[1].z, (std::vector<double>{3, 4}));
  EXPECT_EQ(laws[1].id, kernels::LawId::learned);
}

TEST(LawCost, IsATimeAParticleAndStep) {
  const testing::Scratch scratch;
  const Dataset data = drawn_dataset(testing::small_set(), scratch.file("d.h5"));
  kernels::LawDescription small = setups()[0].law(), large;
  large.id = kernels::LawId::learned;
  large.weights = std::make_shared<kernels::LearnedLawWeights>(
      testing::random_weights(kernels::LawForm::isotropic, 4, 64, 3, kernels::Activation::silu, 5));
  large.z.assign(4, 0.0);
  EXPECT_GT(law_cost(small, data), 0);
  EXPECT_LT(law_cost(small, data), law_cost(large, data));
  EXPECT_LT(law_cost(large, data), 1e6);
}

}  // namespace
}  // namespace uniphy
