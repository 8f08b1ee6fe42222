// The ladder: which rung is chosen, what the adapted law is, and that it resumes.

#include "uniphy/inference/adaptation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "ops/base/torch.hpp"
#include "tests/support/on_threads.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/inference/adaptation_options.hpp"
#include "uniphy/inference/adaptation_state.hpp"
#include "uniphy/inference/fit_findings.hpp"
#include "uniphy/inference/infer_run.hpp"
#include "uniphy/scene/law_config.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

FitHooks quiet() {
  FitHooks hooks;
  hooks.progress = false;
  return hooks;
}

FitOptions schedule() {
  FitOptions options;
  options.stages = {{0.3, 4, 5}, {1, 2, 12}};
  return options;
}

testing::ObservedScene small() {
  testing::ObservedScene scene;
  scene.side = 4;
  scene.grid = 12;
  scene.frames = 21;
  scene.motion = {{0.5, 0.44, 0.5}, {0.4, -2.5, -0.3}, {1.0, -2.0, 3.0}};
  return scene;
}

/// The readable model, and a law whose own numbers are others: no z gives them.
struct Outside {
  ModelFile model = testing::readable_model();
  std::unique_ptr<const FitVariables> variables = make_latent_variables(model);
  Observation observation;

  explicit Outside(double change = 0.4) {
    kernels::LawDescription law = variables->law(variables->start(2));
    auto weights = std::make_shared<kernels::LearnedLawWeights>(*law.weights);
    weights->stress.layers.back().bias[kernels::kShearExponent] += 8 * change;
    weights->stress.layers.back().bias[kernels::kVolumeDelta] -= 8 * change;
    law.weights = weights;
    observation = testing::observe(law, small());
  }
};

AdaptationOptions two_rungs() {
  AdaptationOptions options;
  options.rungs = {Rung::latent, Rung::numbers};
  return options;
}

TEST(Adaptation, ALawOfTheFamilyStopsAtItsCode) {
  const Outside inside(0);
  const Adaptation found =
      adapt(inside.observation, "o", *inside.variables, schedule(), {}, quiet());
  EXPECT_EQ(found.rung, Rung::latent);
  ASSERT_EQ(found.rungs.size(), 1u);
  // The initial velocity comes from frames: the true code itself, start 2, leaves an error too.
  const double truth = std::sqrt(found.fit.start_mse[2]) / 0.225;
  EXPECT_LT(truth, 3e-5);
  EXPECT_LE(found.rungs[0].fitted, 1.01 * truth);
  EXPECT_LE(found.rungs[0].kept, 3 * truth);
  EXPECT_GT(found.rungs[0].roll_outs, 8);
  EXPECT_LE(std::sqrt(found.fit.mse) / 0.225, 1.5 * truth);
  EXPECT_EQ(found.fit.u.size(), 4u);
}

TEST(Adaptation, TheLawsOwnNumbersAreFound) {
  const Outside outside;
  const Adaptation found =
      adapt(outside.observation, "o", *outside.variables, schedule(), two_rungs(), quiet());
  EXPECT_EQ(found.rung, Rung::numbers);
  ASSERT_EQ(found.rungs.size(), 2u);
  EXPECT_GT(found.rungs[0].kept, 1e-3);
  EXPECT_LT(found.rungs[1].kept, 0.05 * found.rungs[0].kept);
  EXPECT_LT(found.rungs[1].fitted, 3e-4);
  EXPECT_THAT(rung_table(found.rung, found.rungs), HasSubstr("numbers"));
}

TEST(Adaptation, AllWeightsGetLowerThanTheCode) {
  const Outside outside;
  AdaptationOptions options;
  options.rungs = {Rung::latent, Rung::weights};
  options.gain = 0.05;
  const Adaptation found =
      adapt(outside.observation, "o", *outside.variables, schedule(), options, quiet());
  EXPECT_EQ(found.rung, Rung::weights);
  EXPECT_LT(found.rungs[1].fitted, 0.5 * found.rungs[0].fitted);
}

TEST(Adaptation, TheAdaptedModelMovesToTheSamePositions) {
  const Outside outside;
  const Inference found =
      infer(outside.observation, "o", *outside.variables, schedule(), quiet(), two_rungs());
  ASSERT_EQ(found.rung, Rung::numbers);
  EXPECT_TRUE(found.explained);
  const testing::Scratch scratch;
  write_model(scratch.file("model.h5"), adapted_model(found, outside.observation, "seen: o"));
  write_latent(scratch.file("latent.h5"),
               latent_of(found, outside.observation, *outside.variables, "model.h5", "seen: o"));
  LawOrigin origin;
  const kernels::LawDescription law = load_fitted_law(scratch.path(), {}, &origin);
  EXPECT_EQ(origin.dt[0], outside.observation.dt);
  EXPECT_EQ(read_latent(scratch.file("latent.h5")).rung, "numbers");
  EXPECT_TRUE(read_latent(scratch.file("latent.h5")).explained);
  const ModelFile model = read_model(scratch.file("model.h5"));
  EXPECT_EQ(model.code(0), found.fit.law.z);

  const std::string name = "o";
  const ObservedSteps steps = observed_steps(outside.observation, name);
  const auto objective = make_motion_objective(outside.observation, steps,
                                               observed_grid(outside.observation, name), "float32");
  std::vector<double> x;
  objective->simulate(law, found.fit.motion, [&](std::ptrdiff_t, const std::vector<double>& at) {
    x.insert(x.end(), at.begin(), at.end());
  });
  EXPECT_EQ(x, found.fitted.x);
}

TEST(Adaptation, GoesOnToTheSameBits) {
  const Outside outside;
  AdaptationOptions options;
  options.iterations = 4;
  options.epochs = 6;
  options.gain = 0;  // climbs to the top
  options.enough = 1e-9;
  const auto run = [&](const FitHooks& hooks) {
    return adapt(outside.observation, "o", *outside.variables, schedule(), options, hooks);
  };
  int records = 0;
  FitHooks counting = quiet();
  counting.on_record = [&](const FitRecord&) { ++records; };
  const Adaptation whole = testing::on_threads(1, [&] { return run(counting); });

  const testing::Scratch scratch;
  FitHooks hooks = quiet();
  hooks.state_file = scratch.file("state.h5");
  hooks.fingerprint = "f";
  hooks.save_seconds = 0;
  struct Stopped {};
  for (const int stop : {records / 3, records / 4, records / 5}) {
    int seen = 0;
    hooks.on_record = [&](const FitRecord&) {
      if (++seen == stop) throw Stopped();
    };
    EXPECT_THROW(run(hooks), Stopped);
  }
  int more = 0;
  hooks.on_record = [&](const FitRecord&) { ++more; };
  const Adaptation resumed = testing::on_threads(2, [&] { return run(hooks); });
  // A step that was stopped is made again, with all roll-outs of its Jacobian.
  EXPECT_LT(more, 2 * records / 3);
  EXPECT_EQ(resumed.rung, whole.rung);
  EXPECT_EQ(resumed.fit.mse, whole.fit.mse);
  EXPECT_EQ(resumed.fit.u, whole.fit.u);
  ASSERT_EQ(resumed.rungs.size(), whole.rungs.size());
  for (std::size_t i = 0; i < whole.rungs.size(); ++i) {
    EXPECT_EQ(resumed.rungs[i].fitted, whole.rungs[i].fitted);
    EXPECT_EQ(resumed.rungs[i].kept, whole.rungs[i].kept);
    EXPECT_EQ(resumed.rungs[i].roll_outs, whole.rungs[i].roll_outs);
  }
  for (const auto part :
       {&kernels::LearnedLawWeights::projection, &kernels::LearnedLawWeights::stress}) {
    const auto &a = (*whole.fit.law.weights).*part, &b = (*resumed.fit.law.weights).*part;
    EXPECT_EQ(a.layers.back().bias, b.layers.back().bias);
    EXPECT_EQ(a.layers.back().weight, b.layers.back().weight);
  }

  hooks.fingerprint = "another";
  EXPECT_THAT(testing::error_of([&] { run(hooks); }), HasSubstr("fingerprint"));
}

TEST(Adaptation, WhatNoLawExplainsIsSaid) {
  Outside inside(0);
  Observation& o = inside.observation;
  for (std::int64_t f = 0; f < o.frames; ++f) {  // swells towards one side, more and more
    for (std::int64_t p = 0; p < o.particles; ++p) {
      double* x = o.x.data() + 3 * (f * o.particles + p);
      const double height = o.positions(0)[3 * p + 1] - 0.3;
      x[0] += 0.2 * std::pow(double(f) / double(o.frames), 3) * height;
    }
  }
  AdaptationOptions options;
  options.epochs = 15;
  const Inference found = infer(o, "o", *inside.variables, schedule(), quiet(), options);
  EXPECT_FALSE(found.explained);
  EXPECT_GT(found.misfit.over_size, found.misfit.allowed);
  EXPECT_THAT(fit_warnings(found, o, *inside.variables),
              ::testing::Contains(HasSubstr("does not explain the motion")));
  Metrics metrics;
  add_metrics(metrics, found, o, *inside.variables);
  EXPECT_EQ(metrics.find("explained"), 0);
  EXPECT_EQ(metrics.find("rung"), static_cast<double>(found.rung));
  EXPECT_TRUE(metrics.find("kept_over_size.latent").has_value());
}

TEST(Adaptation, AnalyticLawsHaveNoRungs) {
  testing::ObservedScene scene = small();
  const Observation o = testing::observe(testing::elastic_body(), scene);
  const auto variables =
      make_analytic_variables(kernels::LawId::elastic, {{1e4, 1e5}, {1e4, 1e5}}, 4, 1);
  const Adaptation found = adapt(o, "o", *variables, schedule(), {}, quiet());
  EXPECT_EQ(found.rung, Rung::latent);
  EXPECT_TRUE(found.rungs.empty());
}

/// Few frames of free flight know the velocity badly, and the noise of the first positions is that
/// of the body: a velocity that is held while the law is far off ends with both off.
TEST(Adaptation, ASoftBodyWithNoiseIsFoundDownToTheNoise) {
  testing::ObservedScene scene;
  scene.frames = 181;
  scene.every = 3;
  scene.motion = {{0.5, 0.345, 0.5}, {0.2, -2, -0.3}, {6.6, 1.8, -0.6}};
  Observation o = testing::observe(testing::elastic_body(3e3, 3e4), scene);
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 0.005 * scene.box);
  for (double& x : o.x) x += noise(random);
  const auto variables =
      make_analytic_variables(kernels::LawId::elastic, {{1e3, 1e6}, {1e3, 1e6}}, 12, 1);
  FitOptions options = schedule();
  options.stages = {{0.25, 6, 8}, {0.5, 4, 8}, {1, 2, 20}};
  AdaptationOptions adaptation = two_rungs();
  adaptation.samples = 0;
  const Adaptation found = adapt(o, "o", *variables, options, adaptation, quiet());
  EXPECT_TRUE(found.starts_fitted);
  EXPECT_LT(std::sqrt(found.fit.mse), 1.02 * 0.005 * scene.box);
  EXPECT_NEAR(found.fit.law.mu, 3e3, 0.03 * 3e3);
  EXPECT_NEAR(found.fit.law.lambda, 3e4, 0.1 * 3e4);
}

struct BadKey {
  const char* name;
  const char* yaml;
  const char* message;
};
std::ostream& operator<<(std::ostream& out, const BadKey& b) { return out << b.name; }

class BadAdaptationKeys : public ::testing::TestWithParam<BadKey> {};

TEST_P(BadAdaptationKeys, AreRefused) {
  const std::string message = testing::error_of([] {
    const Config config = Config::parse(GetParam().yaml, "c.yaml");
    Section root = config.root();
    read_adaptation_options(root);
    config.finish();
  });
  EXPECT_THAT(message, HasSubstr("adaptation"));
  EXPECT_THAT(message, HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Keys, BadAdaptationKeys,
    ::testing::Values(BadKey{"NoLatent", "adaptation: {rungs: [numbers]}", "expected latent first"},
                      BadKey{"Order", "adaptation: {rungs: [latent, weights, numbers]}",
                             "expected latent first"},
                      BadKey{"Name", "adaptation: {rungs: [latent, all]}", "numbers"},
                      BadKey{"Kept", "adaptation: {kept: 1}", "kept"},
                      BadKey{"Gain", "adaptation: {gain: 1}", "gain"},
                      BadKey{"Pull", "adaptation: {pull: -1}", "pull"},
                      BadKey{"Unknown", "adaptation: {steps: 3}", "steps"}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace uniphy
