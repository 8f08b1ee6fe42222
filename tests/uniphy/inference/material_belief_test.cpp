#include "uniphy/inference/material_belief.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace uniphy {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

MaterialReading reading(const std::string& material, double mu) {
  MaterialReading m;
  m.material = material;
  m.mu = mu;
  m.strain_seen = 0.3;
  return m;
}

TEST(MaterialBelief, IntervalsAndProbabilityOfTheMaterialFound) {
  std::vector<MaterialReading> samples;
  for (int i = 0; i <= 100; ++i) samples.push_back(reading("elastic", 1000 + i));
  for (int i = 0; i < 101; ++i) samples.push_back(reading(i % 2 == 0 ? "elastic" : "sand", 1050));
  const MaterialBelief belief = material_belief(reading("elastic", 1040), samples);
  EXPECT_EQ(belief.reading.mu, 1040);
  ASSERT_EQ(belief.probability.size(), 2u);
  EXPECT_EQ(belief.probability[0].first, "elastic");
  EXPECT_DOUBLE_EQ(belief.probability[0].second, 152.0 / 202);
  EXPECT_NEAR(belief.low.mu, 1007.5, 0.1);  // 5 % of 152 from below
  EXPECT_NEAR(belief.high.mu, 1092.5, 0.1);
  EXPECT_TRUE(std::isnan(belief.low.viscosity));
  const std::string text = belief_text(belief);
  EXPECT_THAT(text, HasSubstr("behaves like: elastic (probability 0.75; sand 0.25), up to a shear "
                              "of 0.3"));
  EXPECT_THAT(text, HasSubstr("shear modulus mu 1040 Pa [1008, 1092]"));
  EXPECT_THAT(text, HasSubstr("viscosity n/a"));
}

TEST(MaterialBelief, TheMostLikelyMaterialIsNamed) {
  std::vector<MaterialReading> samples;
  for (int i = 0; i < 30; ++i) samples.push_back(reading(i < 20 ? "sand" : "elastic", 10 + i));
  const MaterialBelief belief = material_belief(reading("elastic", 1), samples);
  EXPECT_EQ(belief.reading.material, "sand");
  EXPECT_EQ(belief.reading.mu, 19.5);
}

TEST(MaterialBelief, FewSamplesGiveNoInterval) {
  const std::vector<MaterialReading> samples(9, reading("sand", 5));
  const MaterialBelief belief = material_belief(reading("sand", 5), samples);
  EXPECT_TRUE(std::isnan(belief.low.mu));
  EXPECT_TRUE(material_belief(reading("sand", 5), {}).probability.empty());
  EXPECT_THAT(belief_text(material_belief(reading("sand", 5), {})), Not(HasSubstr("probability")));
}

}  // namespace
}  // namespace uniphy
