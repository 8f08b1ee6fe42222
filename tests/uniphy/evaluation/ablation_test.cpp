// uniphy_ablate, from the configuration to the files, at a tiny size.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/uniphy/evaluation/small_run.hpp"
#include "uniphy/evaluation/ablation_report.hpp"
#include "uniphy/evaluation/ablation_stage.hpp"
#include "uniphy/io/dataset.hpp"
#include "uniphy/io/model_file.hpp"
#include "uniphy/training/train_stage.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

std::string config(const std::string& budget, const std::string& variants) {
  return "seed: 2\ntrajectories: 2\nheldout_trajectories: 1\nbudget: " + budget +
         "\nmodel: {width: 8, hidden_layers: 1, latent_size: 4}\n" + testing::kSmallSets +
         "variants:\n" + variants;
}

constexpr const char* kTwo =
    "  - {name: base, group: form}\n"
    "  - {name: published, group: form, trajectories: 1, model: {form: published, width: 6}}\n";

TEST(Ablation, KeepsFinishedVariants) {
  const testing::Scratch scratch;
  const std::string yaml = config("{type: steps, steps: 12}", kTwo);
  const Metrics first = testing::run_stage(ablation_stage, yaml, scratch.file("out"));
  EXPECT_EQ(first.find("base.steps"), 12);
  // (3 + 4) 8 + 8 + (8 · 4 + 4) for the caps, (6 + 4) 8 + 8 + (8 · 8 + 8) for the stress.
  EXPECT_EQ(first.find("base.parameters"), 56 + 8 + 45 + 80 + 8 + 126);
  for (const char* name : {"law_ns", "train_s", "stress_error", "rollout_error.sand.worst",
                           "projection_error.newtonian", "rollouts_failed"}) {
    EXPECT_TRUE(first.find(std::string("published.") + name)) << name;
  }
  EXPECT_GT(*first.find("base.law_ns"), 0);
  const std::string table = read_text_file(scratch.file("out/ablation.md"));
  EXPECT_THAT(table, HasSubstr("| base | isotropic | 1 x 8 | 4 | 5 x 2 | 323 | 12 | "));
  EXPECT_THAT(table, HasSubstr("| published | published | 1 x 6 | 4 | 5 x 1 | "));
  const std::string csv = read_text_file(scratch.file("out/ablation.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);

  // A second run reads what is there, times and all; a variant that was lost is made again, to the
  // same bits.
  EXPECT_EQ(testing::run_stage(ablation_stage, yaml, scratch.file("out")).json(), first.json());
  std::filesystem::remove_all(scratch.file("out/published"));
  const Metrics again = testing::run_stage(ablation_stage, yaml, scratch.file("out"), 1);
  EXPECT_EQ(again.find("base.train_s"), first.find("base.train_s"));
  EXPECT_EQ(again.find("published.stress_error"), first.find("published.stress_error"));
  EXPECT_EQ(again.find("published.rollouts_failed"), first.find("published.rollouts_failed"));
}

TEST(Ablation, TrainedModelsKnowTheTimeStepsOfTheirData) {
  const testing::Scratch scratch;
  testing::run_stage(ablation_stage, config("{type: steps, steps: 2}", "  - {name: a}\n"),
                     scratch.file("out"));
  const std::filesystem::path data = scratch.file("out/data/train_2.h5");
  const std::array<double, 2> dt = time_steps(read_dataset(data));
  EXPECT_GT(dt[0], 0);
  EXPECT_EQ(read_model(scratch.file("out/a/model.h5")).training_dt, dt);
  testing::run_stage(train_stage,
                     "data: " + data.string() +
                         "\nmodel: {width: 8, hidden_layers: 1, latent_size: 4}\n"
                         "training: {steps: 2}\n",
                     scratch.file("trained"));
  EXPECT_EQ(read_model(scratch.file("trained/model.h5")).training_dt, dt);
}

TEST(Ablation, OtherSettingsAreNotMixed) {
  const testing::Scratch scratch;
  testing::run_stage(ablation_stage,
                     config("{type: steps, steps: 3}", "  - {name: a, trajectories: 1}\n"),
                     scratch.file("out"));
  EXPECT_EQ(testing::without_directory(testing::error_of([&] {
                                         testing::run_stage(
                                             ablation_stage,
                                             config("{type: steps, steps: 4}",
                                                    "  - {name: a, trajectories: 1}\n"),
                                             scratch.file("out"));
                                       }),
                                       scratch.file("out")),
            "a: was made with other settings (settings.txt); remove it or choose another --out");
}

TEST(Ablation, ABudgetOfSecondsBecomesStepsOnce) {
  const testing::Scratch scratch;
  const std::string yaml =
      config("{type: seconds, seconds: 0.5}", "  - {name: a, trajectories: 1}\n");
  const Metrics first = testing::run_stage(ablation_stage, yaml, scratch.file("out"));
  EXPECT_EQ(std::stod(read_text_file(scratch.file("out/a/steps.txt"))), first.find("a.steps"));
  // As after an interruption: the number of steps stays.
  std::filesystem::remove(scratch.file("out/a/metrics.json"));
  const Metrics again = testing::run_stage(ablation_stage, yaml, scratch.file("out"));
  EXPECT_EQ(again.find("a.steps"), first.find("a.steps"));
  EXPECT_EQ(again.find("a.stress_error"), first.find("a.stress_error"));
}

}  // namespace
}  // namespace uniphy
