// What uniphy_evaluate and uniphy_ablate refuse, with the whole message.

#include <gtest/gtest.h>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/evaluation/ablation_stage.hpp"
#include "uniphy/evaluation/evaluate_stage.hpp"

namespace uniphy {
namespace {

struct BadConfig {
  const char* name;
  RunFunction (*declare)(Section&);
  const char* yaml;
  const char* message;
};
std::ostream& operator<<(std::ostream& out, const BadConfig& b) { return out << b.name; }

class BadEvaluation : public ::testing::TestWithParam<BadConfig> {};

TEST_P(BadEvaluation, IsRefused) {
  // @: a file that exists.
  std::string yaml = GetParam().yaml;
  const testing::Scratch scratch;
  const std::string file = scratch.write("there.h5", "").string();
  for (std::size_t at; (at = yaml.find('@')) != std::string::npos;) yaml.replace(at, 1, file);
  EXPECT_EQ(testing::without_directory(testing::error_of([&] {
                                         const Config config = Config::parse(yaml, "c.yaml");
                                         Section root = config.root();
                                         GetParam().declare(root);
                                         config.finish();
                                       }),
                                       scratch.path()),
            GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    Evaluate, BadEvaluation,
    ::testing::Values(
        BadConfig{
            "UnknownKind", evaluate_stage, "kind: rollout\n",
            "c.yaml:1: kind: expected one of trajectory, heldout, outside, open_world, touching, "
            "materials, found \"rollout\""},
        BadConfig{"NoTrajectory", evaluate_stage, "frames: all\n",
                  "c.yaml:1: trajectory: required key is missing, expected a file"},
        BadConfig{
            "KeyOfTheOtherKind", evaluate_stage, "kind: heldout\nmodel: '@'\nreference: '@'\n",
            "c.yaml:3: reference: unknown key; known keys here: kind, seed, model, trajectories, "
            "attempts, materials, ranges, simulation, body, motion, samples, fit, rest"},
        BadConfig{
            "SeedOfATrajectory", evaluate_stage, "trajectory: '@'\nreference: '@'\nseed: 3\n",
            "c.yaml:3: seed: unknown key; known keys here: kind, trajectory, reference, frames"},
        BadConfig{"NoModel", evaluate_stage, "kind: heldout\nmodel: none.h5\n",
                  "c.yaml:2: model: expected a file, found \"none.h5\", which does not exist"},
        BadConfig{"NegativeSeed", evaluate_stage, "kind: heldout\nmodel: '@'\nseed: -1\n",
                  "c.yaml:3: seed: expected an integer in [0, 9e+15], found \"-1\""},
        BadConfig{"NoTrajectories", evaluate_stage, "kind: heldout\nmodel: '@'\ntrajectories: 0\n",
                  "c.yaml:3: trajectories: expected an integer in [1, 100000], found \"0\""},
        BadConfig{"SplitIsNotFree", evaluate_stage, "kind: heldout\nmodel: '@'\nsplit: train\n",
                  "c.yaml:3: split: unknown key; known keys here: kind, seed, model, trajectories, "
                  "attempts, materials, ranges, simulation, body, motion, samples, fit, rest"},
        BadConfig{"NoStarts", evaluate_stage, "kind: heldout\nmodel: '@'\nfit: {starts: 0}\n",
                  "c.yaml:3: fit.starts: expected an integer in [1, 64], found \"0\""},
        BadConfig{"NoRest", evaluate_stage, "kind: heldout\nmodel: '@'\nrest: {steps: 0}\n",
                  "c.yaml:3: rest.steps: expected an integer >= 1, found \"0\""},
        BadConfig{"FewAtRest", evaluate_stage, "kind: heldout\nmodel: '@'\nrest: {particles: 7}\n",
                  "c.yaml:3: rest.particles: expected an integer in [8, 100000], found \"7\""}),
    [](const auto& info) { return std::string(info.param.name); });

INSTANTIATE_TEST_SUITE_P(
    Outside, BadEvaluation,
    ::testing::Values(
        BadConfig{
            "NameOfAPath", evaluate_stage,
            "kind: outside\nmodel: '@'\nlaws:\n  - {name: a/b, law: {type: water, lambda: 1e5}}\n",
            "c.yaml:4: laws.0.name: expected letters, digits, _, - and . (no dot first), found "
            "\"a/b\""},
        BadConfig{
            "SameNames", evaluate_stage,
            "kind: outside\nmodel: '@'\nlaws:\n  - {name: a, law: {type: water, lambda: 1e5}}\n"
            "observations:\n  - {name: a, file: '@'}\n",
            "c.yaml:6: observations.0.name: expected names that differ, found \"a\" twice"},
        BadConfig{
            "NoFile", evaluate_stage,
            "kind: outside\nmodel: '@'\nobservations:\n  - {name: a, file: none.h5}\n",
            "c.yaml:4: observations.0.file: expected a file, found \"none.h5\", which does not "
            "exist"},
        BadConfig{
            "LawWithoutNumbers", evaluate_stage,
            "kind: outside\nmodel: '@'\nlaws:\n  - {name: a, law: {type: water}}\n",
            "c.yaml:4: laws.0.law.lambda: required key is missing, expected a finite number > 0 "
            "(Pa)"},
        BadConfig{"FewSteps", evaluate_stage, "kind: outside\nmodel: '@'\nscene: {steps: 5}\n",
                  "c.yaml:3: scene.steps: expected an integer in [20, 1e+06], found \"5\""}),
    [](const auto& info) { return std::string(info.param.name); });

INSTANTIATE_TEST_SUITE_P(
    Ablate, BadEvaluation,
    ::testing::Values(
        BadConfig{
            "NoVariants", ablation_stage, "seed: 1\n",
            "c.yaml:1: variants: required key is missing, expected a list of maps, at least 1"},
        BadConfig{"EmptyVariants", ablation_stage, "variants: []\n",
                  "c.yaml:1: variants: expected a list of maps, at least 1, found a list of 0"},
        BadConfig{"NoName", ablation_stage, "variants:\n  - {group: a}\n",
                  "c.yaml:2: variants.0.name: required key is missing, expected a text"},
        BadConfig{"NameOfAPath", ablation_stage, "variants:\n  - {name: ../a}\n",
                  "c.yaml:2: variants.0.name: expected letters, digits, _, - and . (no dot first, "
                  "not data), found \"../a\""},
        BadConfig{"NameOfTheData", ablation_stage, "variants:\n  - {name: data}\n",
                  "c.yaml:2: variants.0.name: expected letters, digits, _, - and . (no dot first, "
                  "not data), found \"data\""},
        BadConfig{"SameNames", ablation_stage, "variants:\n  - {name: a}\n  - {name: a}\n",
                  "c.yaml:3: variants.1.name: expected names that differ, found \"a\" twice"},
        BadConfig{"StepsOfAVariant", ablation_stage,
                  "variants:\n  - {name: a, training: {steps: 5}}\n",
                  "c.yaml:2: variants.0.training.steps: unknown key; known keys here: seed, "
                  "batch_per_trajectory, learning_rate, latent_rate, weight_decay, latent_sigma, "
                  "prior_weight, error_floor, loss, delta, clip, clip_each, caps_share, "
                  "checkpoint_every"},
        BadConfig{"SquaresOfTheIsotropicForm", ablation_stage,
                  "variants:\n  - {name: a, training: {loss: squared}}\n",
                  "c.yaml:2: variants.0.training.loss: expected logarithm: form isotropic has no "
                  "other loss"},
        BadConfig{"OneLatentNumber", ablation_stage,
                  "variants:\n  - {name: a, model: {latent_size: 1}}\n",
                  "c.yaml:2: variants.0.model.latent_size: expected 2 or more: the law takes its "
                  "scales from two"},
        BadConfig{"UnknownForm", ablation_stage, "variants:\n  - {name: a, model: {form: cubic}}\n",
                  "c.yaml:2: variants.0.model.form: expected one of isotropic, published, found "
                  "\"cubic\""},
        BadConfig{"UnknownBudget", ablation_stage,
                  "budget: {type: hours}\nvariants:\n  - {name: a}\n",
                  "c.yaml:1: budget.type: expected one of steps, seconds, found \"hours\""},
        BadConfig{"BothBudgets", ablation_stage,
                  "budget: {type: seconds, seconds: 5, steps: 5}\nvariants:\n  - {name: a}\n",
                  "c.yaml:1: budget.steps: unknown key; known keys here: type, seconds"},
        BadConfig{"NoTime", ablation_stage,
                  "budget: {type: seconds, seconds: 0}\nvariants:\n  - {name: a}\n",
                  "c.yaml:1: budget.seconds: expected a finite number > 0 (s), found \"0\""}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace uniphy
