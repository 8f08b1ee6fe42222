// kind: touching of uniphy_evaluate, from the configuration to the files, at a tiny size.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/uniphy/evaluation/small_run.hpp"
#include "uniphy/evaluation/evaluate_stage.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

TEST(Touching, MakesTheTableAndGoesOn) {
  const testing::Scratch scratch;
  const std::filesystem::path out = scratch.file("out");
  write_model(scratch.file("model.h5"), testing::readable_model(4));
  const std::string yaml =
      "{kind: touching, model: " + scratch.file("model.h5").string() +
      ", pairs: 1, cases: [closed], adaptation: {rungs: [latent], samples: 0, iterations: 2}, "
      "scene: {steps: 300, particles_per_side: 3}, "
      "fit: {schedule: {horizon: [1], candidates: [2], epochs: [2]}}}";
  const Metrics first = testing::run_stage(evaluate_stage, yaml, out);
  const std::string table = read_text_file(out / "touching.md");
  EXPECT_THAT(table, HasSubstr("| closed | plasticine | sand |"));
  for (const char* body : {"lower", "upper"}) {
    const std::string name = std::string("closed.plasticine.sand.") + body;
    ASSERT_TRUE(first.find("forecast." + name)) << name;
    EXPECT_GT(*first.find("forecast." + name), 0);
    EXPECT_LT(*first.find("forecast." + name), 0.5);
    EXPECT_LT(*first.find("fit." + name), 0.5);
  }
  // The finished pair is taken from the disk: the same seconds.
  EXPECT_EQ(testing::run_stage(evaluate_stage, yaml, out, 1).json(), first.json());
}

}  // namespace
}  // namespace uniphy
