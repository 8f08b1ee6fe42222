// The configurations of the repository, and the kind that a configuration without `kind` has.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/uniphy/evaluation/small_run.hpp"
#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/evaluation/ablation_options.hpp"
#include "uniphy/evaluation/evaluate_stage.hpp"
#include "uniphy/evaluation/rollout_error.hpp"

namespace uniphy {
namespace {

const std::filesystem::path kConfigs = std::filesystem::path(UNIPHY_SOURCE_DIR) / "configs";

TEST(ShippedConfigs, CompareTrajectories) {
  const testing::Scratch scratch;
  const TrajectorySetup setup = draw_setup(testing::small_set(), 0, 0);
  kernels::LawDescription law = setup.law();
  law.mu *= 1.3;
  write_trajectory(scratch.file("a.h5"), roll_out(setup, law));
  write_trajectory(scratch.file("b.h5"), roll_out(setup, setup.law()));
  const Config config = Config::load(kConfigs / "evaluate/trajectory.yaml",
                                     {"trajectory=" + scratch.file("a.h5").string(),
                                      "reference=" + scratch.file("b.h5").string()});
  Section root = config.root();
  const RunFunction work = evaluate_stage(root);
  config.finish();
  RunDirectory out(scratch.path(), config.resolved(), 1);
  Metrics metrics;
  work(out, metrics);
  EXPECT_EQ(metrics.find("frames"), 13);
  EXPECT_GT(*metrics.find("position_mse"), 0);
  EXPECT_EQ(*metrics.find("root_over_size"),
            std::sqrt(*metrics.find("position_mse")) / *metrics.find("size"));
  EXPECT_TRUE(std::filesystem::exists(scratch.file("curve.csv")));
}

TEST(ShippedConfigs, EvaluateHeldOutSets) {
  const testing::Scratch scratch;
  const std::string model = "model=" + scratch.write("model.h5", "").string();
  const Config config =
      Config::load(kConfigs / "evaluate/heldout.yaml", {model, "seed=12", "trajectories=2"});
  Section root = config.root();
  evaluate_stage(root);
  EXPECT_NO_THROW(config.finish());
}

TEST(ShippedConfigs, EvaluateLawsFromOutside) {
  const testing::Scratch scratch;
  const std::string model = "model=" + scratch.write("model.h5", "").string();
  for (const char* quick : {"quick=true", "quick=false"}) {
    const Config config = Config::load(kConfigs / "evaluate/outside.yaml", {model, quick});
    Section root = config.root();
    evaluate_stage(root);
    EXPECT_NO_THROW(config.finish());
  }
}

TEST(ShippedConfigs, AblateEverySizeOfTheIssue) {
  const Config config = Config::load(kConfigs / "ablation/ablation.yaml");
  Section root = config.root();
  const AblationOptions o = read_ablation_options(root);
  EXPECT_NO_THROW(config.finish());
  std::vector<std::int64_t> widths, latents, trajectories;
  int published_form = 0;
  for (const AblationVariant& v : o.variants) {
    const models::LearnedLawOptions& n = v.training.law;
    EXPECT_EQ(v.training.steps, o.variants[0].training.steps) << v.name;
    // Every step of every variant sees as many samples, to 2 %.
    EXPECT_NEAR(static_cast<double>(v.trajectories * v.training.batch_per_trajectory), 2560, 52);
    if (n.form == kernels::LawForm::published) {
      ++published_form;
      continue;
    }
    widths.push_back(n.width);
    latents.push_back(n.latent_size);
    trajectories.push_back(v.trajectories);
  }
  EXPECT_GE(published_form, 1);
  const auto has = [](const std::vector<std::int64_t>& list, std::int64_t value) {
    return std::find(list.begin(), list.end(), value) != list.end();
  };
  for (const int width : {16, 32, 64, 128}) EXPECT_TRUE(has(widths, width)) << width;
  for (const int size : {2, 4, 8, 16, 32}) EXPECT_TRUE(has(latents, size)) << size;
  for (const int count : {10, 40, 200}) EXPECT_TRUE(has(trajectories, count)) << count;
}

}  // namespace
}  // namespace uniphy
