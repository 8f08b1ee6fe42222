#include "uniphy/inference/fit_variables.hpp"

#include <gtest/gtest.h>

#include "tests/uniphy/inference/observed_scene.hpp"

namespace uniphy {
namespace {

// Laws drawn at random are starts of a fit, but no names for what it finds.
TEST(FitVariables, NameTheNearestOfTheFamilies) {
  ModelFile model = testing::readable_model(6);
  model.materials = {"elastic",        "random_solid", "plasticine",
                     "random_plastic", "random_fluid", "elastic"};
  const auto variables = make_latent_variables(model);
  EXPECT_EQ(variables->starts(), 6);
  EXPECT_EQ(variables->label(3), "random_plastic");
  const auto near = variables->nearest(variables->start(3), 6);
  ASSERT_EQ(near.size(), 3u);
  for (const NearestCode& code : near) {
    EXPECT_TRUE(code.material == "elastic" || code.material == "plasticine");
    EXPECT_EQ(code.material, variables->label(code.code));
    EXPECT_GT(code.distance, 0);
  }
  EXPECT_LE(near[0].distance, near[1].distance);

  // A model that knows no others.
  model.materials.assign(6, "random_solid");
  EXPECT_EQ(make_latent_variables(model)->nearest(variables->start(3), 2).front().code, 3);
}

}  // namespace
}  // namespace uniphy
