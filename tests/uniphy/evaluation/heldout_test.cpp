// uniphy_evaluate with kind: heldout, from the configuration to the files, at a tiny size.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/uniphy/evaluation/small_run.hpp"
#include "uniphy/data/generate.hpp"
#include "uniphy/evaluation/evaluate_stage.hpp"
#include "uniphy/evaluation/heldout_stage.hpp"
#include "uniphy/io/model_file.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

class Heldout : public ::testing::Test {
 protected:
  void SetUp() override { write_model(scratch.file("model.h5"), testing::readable_model()); }
  std::string config(const std::string& more = "") const {
    return "kind: heldout\nseed: 3\ntrajectories: 1\nmodel: " + scratch.file("model.h5").string() +
           "\nrest: {steps: 20, particles: 27}\n" + testing::kSmallSets + more;
  }
  Metrics run(const std::string& name, int threads = 2, const std::string& more = "") const {
    return testing::run_stage(evaluate_stage, config(more), scratch.file(name), threads);
  }
  testing::Scratch scratch;
};

bool is_time(const std::string& name) {
  return name.size() > 2 && name.compare(name.size() - 2, 2, "_s") == 0;
}

TEST_F(Heldout, WritesEveryMetricAndProduct) {
  const Metrics metrics = run("out");
  for (const std::string prefix : {"", "heldout_materials."}) {
    for (const std::string error : {"stress_error.", "projection_error.", "rollout_error."}) {
      for (const char* material : {"elastic", "newtonian", "plasticine", "sand", "non_newtonian"}) {
        std::string name = prefix + error + material;
        // A material that projects nothing has an absolute error of its own.
        if (error == "projection_error." && !metrics.find(name))
          name = prefix + "unprojected_error." + material;
        ASSERT_TRUE(metrics.find(name)) << name;
        EXPECT_GE(*metrics.find(name), 0);
        // One trajectory of each: the worst is the median.
        EXPECT_EQ(metrics.find(name), metrics.find(name + ".worst"));
      }
    }
  }
  EXPECT_TRUE(metrics.find("rollouts_failed"));
  EXPECT_TRUE(metrics.find("heldout_materials.rollouts_failed"));
  // The form of the test's model is isotropic.
  EXPECT_LT(*metrics.find("frame_indifference"), 1e-6);
  EXPECT_LT(*metrics.find("rest_drift"), 1e-9);
  EXPECT_EQ(metrics.find("codes_at_rest"), 18);  // 8 of training, 10 fitted

  const std::string csv = read_text_file(scratch.file("out/errors.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 11);
  EXPECT_THAT(csv, ::testing::StartsWith("set,trajectory,material,shape,motion,mu,lambda,tau_y,"
                                         "theta,eta,dt,stress_error,projection_error,"
                                         "rollout_error,failure,z\nheldout_all,0,elastic,"));
  const std::string table = read_text_file(scratch.file("out/errors.md"));
  EXPECT_THAT(table, HasSubstr("| roll-out, new materials | "));
  EXPECT_THAT(table, HasSubstr("Seed 3, 1 trajectories"));
}

TEST_F(Heldout, SameBitsOnOneThreadAndTwoAndWhenDoneAgain) {
  const Metrics one = run("one", 1), two = run("two", 2);
  const auto written = std::filesystem::last_write_time(scratch.file("two/heldout_all.h5"));
  const Metrics again = run("two", 2);
  // The sets were not drawn again.
  EXPECT_EQ(std::filesystem::last_write_time(scratch.file("two/heldout_all.h5")), written);
  for (const auto& [name, value] : one.entries()) {
    if (is_time(name)) continue;
    EXPECT_EQ(two.find(name), value) << name;
    EXPECT_EQ(again.find(name), value) << name;
  }
  EXPECT_EQ(read_text_file(scratch.file("one/errors.csv")),
            read_text_file(scratch.file("two/errors.csv")));
}

TEST_F(Heldout, AnotherSeedDrawsOtherSetsInTheSamePlace) {
  run("out");
  const std::string before = read_text_file(scratch.file("out/errors.csv"));
  testing::run_stage(
      evaluate_stage,
      "kind: heldout\nseed: 4\ntrajectories: 1\nmodel: " + scratch.file("model.h5").string() +
          "\nrest: {steps: 20, particles: 27}\n" + testing::kSmallSets,
      scratch.file("out"));
  EXPECT_NE(read_text_file(scratch.file("out/errors.csv")), before);
  EXPECT_EQ(read_dataset(scratch.file("out/heldout_all.h5")).trajectories[0].seed, 4);
}

TEST_F(Heldout, TheSetsAreThoseOfGenerate) {
  run("out");
  GenerateOptions options = testing::small_set("seed: 3\nsplit: heldout_all\n");
  drawn_dataset(options, scratch.file("generated.h5"));
  EXPECT_TRUE(read_text_file(scratch.file("generated.h5")) ==
              read_text_file(scratch.file("out/heldout_all.h5")));
}

TEST_F(Heldout, AModelWithoutCodesIsRefused) {
  ModelFile model = testing::readable_model();
  model.latents.clear();
  model.materials.clear();
  model.parameters.clear();
  write_model(scratch.file("model.h5"), model);
  EXPECT_THAT(testing::error_of([&] { run("out"); }),
              HasSubstr("model.h5: expected latent codes to start the fits from, found none"));
}

}  // namespace
}  // namespace uniphy
