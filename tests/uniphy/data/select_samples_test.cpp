#include "uniphy/data/select_samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

namespace uniphy {
namespace {

using ::testing::ElementsAre;

TEST(FillEvenly, GivesEqualSharesUpToTheCapacities) {
  EXPECT_THAT(fill_evenly({10, 10, 10}, 9), ElementsAre(3, 3, 3));
  EXPECT_THAT(fill_evenly({1, 10, 10}, 9), ElementsAre(1, 4, 4));
  EXPECT_THAT(fill_evenly({0, 2, 100}, 50), ElementsAre(0, 2, 48));
  EXPECT_THAT(fill_evenly({3, 4}, 100), ElementsAre(3, 4));
  EXPECT_THAT(fill_evenly({5, 5, 5}, 0), ElementsAre(0, 0, 0));
  const auto odd = fill_evenly({10, 10, 10}, 10);
  EXPECT_EQ(std::accumulate(odd.begin(), odd.end(), std::int64_t{0}), 10);
}

TEST(LevelUp, RaisesTheLowestOpenOnes) {
  EXPECT_THAT(level_up({5, 1, 3}, {true, true, true}, 3), ElementsAre(0, 3, 0));
  EXPECT_THAT(level_up({5, 1, 3}, {true, true, true}, 6), ElementsAre(0, 4, 2));
  EXPECT_THAT(level_up({5, 1, 3}, {true, false, true}, 4), ElementsAre(1, 0, 3));
  EXPECT_THAT(level_up({5, 1}, {false, false}, 4), ElementsAre(0, 0));
}

/// 10000 candidates: nearly all in branch 0, strains over five decades, most of them small.
std::vector<SampleFeatures> crowd() {
  UniformRandom random(3);
  std::vector<SampleFeatures> features(10000);
  for (std::size_t i = 0; i < features.size(); ++i) {
    features[i].branch = i % 100 == 0 ? 1 : 0;
    const double u = random.unit();
    features[i].strain = std::exp(-11.5 * u * u * u * 0.999);
    features[i].strain = 1e-5 / features[i].strain;
    features[i].second = random.log_between(0.1, 10);
  }
  return features;
}

TEST(SelectSamples, SpreadsOverBranchesAndStrains) {
  const auto features = crowd();
  UniformRandom random(4);
  const auto rows = select_samples(features, 2, 400, 0, 1, random);
  ASSERT_EQ(rows.size(), 400u);
  EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
  EXPECT_EQ(std::set<std::int64_t>(rows.begin(), rows.end()).size(), rows.size());
  // Branch 1 has 100 candidates: all of them are taken.
  int second = 0, decade_low = 0, decade_high = 0;
  for (const std::int64_t row : rows) {
    const SampleFeatures& f = features[static_cast<std::size_t>(row)];
    second += f.branch;
    decade_low += f.strain < 1e-4 ? 1 : 0;
    decade_high += f.strain > 1e-1 ? 1 : 0;
  }
  EXPECT_EQ(second, 100);
  // A fifth of the range each; taken as they come it is 58 % and 7 %.
  EXPECT_NEAR(decade_low, 100, 45);
  EXPECT_NEAR(decade_high, 80, 30);
}

TEST(SelectSamples, HoldsTheFirstBranchDownWhereTheOthersSuffice) {
  auto features = crowd();
  for (std::size_t i = 0; i < 5000; ++i) features[i].branch = 1;
  UniformRandom random(5);
  const auto rows = select_samples(features, 2, 500, 0, 0.1, random);
  ASSERT_EQ(rows.size(), 500u);
  EXPECT_EQ(std::count_if(
                rows.begin(), rows.end(),
                [&](std::int64_t r) { return features[static_cast<std::size_t>(r)].branch == 0; }),
            50);
  // The others have too little: the first takes what is left.
  const auto few = select_samples(crowd(), 2, 500, 0, 0.1, random);
  EXPECT_EQ(few.size(), 500u);
}

TEST(SelectSamples, UniformPartFollowsTheSimulation) {
  const auto features = crowd();
  UniformRandom random(6);
  const auto rows = select_samples(features, 2, 2000, 1, 1, random);
  ASSERT_EQ(rows.size(), 2000u);
  const auto second = std::count_if(rows.begin(), rows.end(), [&](std::int64_t r) {
    return features[static_cast<std::size_t>(r)].branch == 1;
  });
  EXPECT_NEAR(static_cast<double>(second), 20, 15);
}

TEST(SelectSamples, TakesAllWhereThereAreFewer) {
  UniformRandom random(7);
  const std::vector<SampleFeatures> three(3);
  EXPECT_THAT(select_samples(three, 2, 10, 0.25, 1, random), ElementsAre(0, 1, 2));
  EXPECT_TRUE(select_samples({}, 2, 10, 0.25, 1, random).empty());
}

}  // namespace
}  // namespace uniphy
