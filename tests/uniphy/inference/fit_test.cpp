#include "uniphy/inference/fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <cmath>

#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/inference/infer_run.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

FitHooks quiet() {
  FitHooks hooks;
  hooks.progress = false;
  return hooks;
}

FitOptions schedule(const std::string& dtype = "float32", const std::string& method = "lbfgs") {
  FitOptions options;
  options.dtype = dtype;
  options.stages = {{0.3, 4, 5, method, 0.1}, {0.6, 2, 6, method, 0.1}, {1, 1, 20, method, 0.1}};
  return options;
}

/// A code between the training codes, and what it does.
struct Hidden {
  ModelFile model = testing::readable_model();
  std::unique_ptr<const FitVariables> variables = make_latent_variables(model);
  kernels::LawDescription law;
  Observation observation;

  Hidden() {
    law = variables->law(variables->start(3));
    law.z[0] += 0.1;
    law.z[2] -= 0.15;
    law.z[3] += 0.3;
    observation = testing::observe(law);
  }
};

TEST(Fit, FindsTheParametersOfAnElasticBody) {
  const Observation o = testing::observe(testing::elastic_body(2e4, 3e4));
  const auto variables =
      make_analytic_variables(kernels::LawId::elastic, {{1e3, 1e6}, {1e3, 1e6}}, 12, 1);
  const FitResult r = fit_observation(o, "o", *variables, schedule(), quiet());
  EXPECT_NEAR(r.law.mu, 2e4, 1);
  EXPECT_NEAR(r.law.lambda, 3e4, 20);
  EXPECT_LT(r.mse, 1e-11);
}

TEST(Fit, FindsAKnownLatentCode) {
  const Hidden hidden;
  FitOptions options = schedule();
  options.stages.back().epochs = 40;
  const FitResult r = fit_observation(hidden.observation, "o", *hidden.variables, options, quiet());
  EXPECT_LT(r.mse, 5e-11);
  EXPECT_LT(r.mse, 1e-4 * *std::min_element(r.start_mse.begin(), r.start_mse.end()));
  const std::vector<double>&found = r.law.z, &true_z = hidden.law.z;
  // What the motion shows: stiffness s/e, yield strain e c₁, ratio of the moduli.
  EXPECT_NEAR(3 * found[0] - 2 * found[1], 3 * true_z[0] - 2 * true_z[1], 5e-3);
  EXPECT_NEAR(std::exp(2 * found[1]) * (1.5 + 2 * found[2]),
              std::exp(2 * true_z[1]) * (1.5 + 2 * true_z[2]), 3e-3);
  EXPECT_NEAR(found[3], true_z[3], 5e-3);
}

TEST(Fit, AdamwImprovesOnEveryStart) {
  const Hidden hidden;
  const FitResult r = fit_observation(hidden.observation, "o", *hidden.variables,
                                      schedule("float32", "adamw"), quiet());
  EXPECT_LT(r.mse, 0.15 * *std::min_element(r.start_mse.begin(), r.start_mse.end()));
}

TEST(Fit, APriorDrawsTheCodeTowardsZero) {
  const Hidden hidden;
  FitOptions options = schedule();
  const auto square = [](const FitResult& r) {
    double sum = 0;
    for (const double z : r.law.z) sum += z * z;
    return sum;
  };
  const FitResult free =
      fit_observation(hidden.observation, "o", *hidden.variables, options, quiet());
  options.prior = 1;  // far more than any error of the motion, in units of the size
  const FitResult drawn =
      fit_observation(hidden.observation, "o", *hidden.variables, options, quiet());
  EXPECT_GT(square(free), 0.01);
  EXPECT_LT(square(drawn), 5e-3 * square(free));
  EXPECT_GT(drawn.mse, 1e6 * free.mse);
  options.prior_sigma = 1e6;  // so wide that it draws at nothing
  const FitResult wide =
      fit_observation(hidden.observation, "o", *hidden.variables, options, quiet());
  EXPECT_GT(square(wide), 0.8 * square(free));
}

TEST(Fit, NoiseIsWhatMakesTheGradientsFitTheVelocityToo) {
  const Hidden hidden;
  Observation noisy = hidden.observation;
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0, 3e-5);
  for (double& x : noisy.x) x += noise(random);
  FitOptions options = schedule("float64");
  noisy.noise = 0;  // as it says
  const FitResult plain = fit_observation(noisy, "o", *hidden.variables, options, quiet());
  noisy.noise = 3e-5;
  options.stages.back().epochs = 40;
  const FitResult fitted = fit_observation(noisy, "o", *hidden.variables, options, quiet());
  const RigidMotion truth = testing::ObservedScene{}.motion;
  EXPECT_LT(fitted.mse, 0.3 * plain.mse);
  EXPECT_LT((fitted.motion.linear - truth.linear).norm(),
            0.5 * (plain.motion.linear - truth.linear).norm());
}

TEST(Fit, LeastSquaresFindsTheCodeAndTheVelocity) {
  const Hidden hidden;
  FitOptions options = schedule("float64", kLevenbergMarquardt);
  const FitResult r = fit_observation(hidden.observation, "o", *hidden.variables, options, quiet());
  EXPECT_LT(r.mse, 5e-12);
  EXPECT_NEAR(r.law.z[3], hidden.law.z[3], 1e-3);
  const RigidMotion truth = testing::ObservedScene{}.motion;
  EXPECT_LT((r.motion.linear - truth.linear).norm(), 2e-4);
  EXPECT_LT((r.motion.angular - truth.angular).norm(), 1e-3);
}

TEST(Fit, OneAndTwoThreadsGiveTheSameBits) {
  const Hidden hidden;
  FitOptions options = schedule();
  options.stages.back().epochs = 6;
  const int before = omp_get_max_threads();
  omp_set_num_threads(1);
  const FitResult one =
      fit_observation(hidden.observation, "o", *hidden.variables, options, quiet());
  omp_set_num_threads(2);
  const FitResult two =
      fit_observation(hidden.observation, "o", *hidden.variables, options, quiet());
  omp_set_num_threads(before);
  EXPECT_EQ(one.u, two.u);
  EXPECT_EQ(one.mse, two.mse);
  EXPECT_EQ(one.start_mse, two.start_mse);
  ASSERT_EQ(one.history.size(), two.history.size());
  for (std::size_t i = 0; i < one.history.size(); ++i) {
    EXPECT_EQ(one.history[i].mse, two.history[i].mse);
    EXPECT_EQ(one.history[i].candidate, two.history[i].candidate);
  }
}

struct Stop {
  const char* optimizer;
  int records;
};
std::ostream& operator<<(std::ostream& out, const Stop& s) {
  return out << s.optimizer << s.records;
}

class StoppedAfter : public ::testing::TestWithParam<Stop> {};

TEST_P(StoppedAfter, GoesOnToTheSameBits) {
  const Hidden hidden;
  const bool differences = std::string(GetParam().optimizer) == kLevenbergMarquardt;
  FitOptions options = schedule(differences ? "float64" : "float32", GetParam().optimizer);
  options.stages.back().epochs = 5;
  const FitResult whole =
      fit_observation(hidden.observation, "o", *hidden.variables, options, quiet());

  const testing::Scratch scratch;
  FitHooks hooks = quiet();
  hooks.state_file = scratch.file("state.h5");
  hooks.fingerprint = fit_fingerprint(hidden.observation, *hidden.variables, "");
  hooks.save_seconds = 0;
  struct Stopped {};
  int records = 0;
  hooks.on_record = [&](const FitRecord&) {
    if (++records == GetParam().records) throw Stopped();
  };
  EXPECT_THROW(fit_observation(hidden.observation, "o", *hidden.variables, options, hooks),
               Stopped);
  int more = 0;
  hooks.on_record = [&](const FitRecord&) { ++more; };
  const FitResult resumed =
      fit_observation(hidden.observation, "o", *hidden.variables, options, hooks);
  EXPECT_LT(more, static_cast<int>(whole.history.size()));
  EXPECT_EQ(resumed.u, whole.u);
  EXPECT_EQ(resumed.mse, whole.mse);
  EXPECT_EQ(resumed.start_mse, whole.start_mse);
  ASSERT_EQ(resumed.history.size(), whole.history.size());
  for (std::size_t i = 0; i < whole.history.size(); ++i) {
    EXPECT_EQ(resumed.history[i].mse, whole.history[i].mse) << i;
  }
}

// In the first stage, between its evaluations; in the second; in the last.
INSTANTIATE_TEST_SUITE_P(Records, StoppedAfter,
                         ::testing::Values(Stop{"lbfgs", 15}, Stop{"lbfgs", 24}, Stop{"lbfgs", 34},
                                           Stop{"adamw", 6}, Stop{"adamw", 24}, Stop{"adamw", 34},
                                           Stop{kLevenbergMarquardt, 80},
                                           Stop{kLevenbergMarquardt, 150}));

TEST(Fit, ACandidateThatFailsIsDroppedAndTheOthersGoOn) {
  Hidden hidden;
  hidden.model.latents[0] = 6;  // a stress scale of 1e4 exp(18) Pa
  hidden.model.latents[8] = 2.5;
  const auto variables = make_latent_variables(hidden.model);
  const FitResult r = fit_observation(hidden.observation, "o", *variables, schedule(), quiet());
  EXPECT_TRUE(std::isinf(r.start_mse[0]));
  EXPECT_LT(r.mse, 5e-10);
  EXPECT_NE(r.start, 0);
}

TEST(Fit, NoStartThatRunsIsAnErrorThatSaysWhy) {
  Hidden hidden;
  for (int i = 0; i < 8; ++i) hidden.model.latents[4 * i] = 6;
  const auto variables = make_latent_variables(hidden.model);
  const std::string message = testing::error_of(
      [&] { fit_observation(hidden.observation, "seen.h5", *variables, schedule(), quiet()); });
  EXPECT_THAT(message,
              HasSubstr("seen.h5: expected that at least one of 8 starts can be simulated"));
  EXPECT_THAT(message, HasSubstr("particle"));
}

TEST(Fit, StartsCoverEveryMaterialAndKeepADistance) {
  const auto variables = make_latent_variables(testing::readable_model(20));
  std::vector<double> early(20), full(20);
  for (int i = 0; i < 20; ++i) {
    early[i] = i % 2 == 0 ? i + 1 : 100 + i;  // the elastic codes are all better at first
    full[i] = 20 - i;
  }
  const std::vector<int> chosen = choose_starts(*variables, early, full, 6);
  ASSERT_EQ(chosen.size(), 6u);
  EXPECT_EQ(chosen[0], 0);   // best at the short horizon
  EXPECT_EQ(chosen[1], 19);  // best over all frames
  EXPECT_EQ(std::set<int>(chosen.begin(), chosen.end()).size(), 6u);
  EXPECT_THAT(choose_starts(*variables, early, full, 100), ::testing::SizeIs(20));
  for (int i = 1; i < 20; ++i) early[i] = std::numeric_limits<double>::infinity();
  full = early;
  EXPECT_THAT(choose_starts(*variables, early, full, 6), ::testing::ElementsAre(0));
}

TEST(Fit, OnlyStartsThatAreAheadAtTheFirstHorizonSeeAllFrames) {
  Hidden hidden;
  hidden.model = testing::readable_model(200);
  const auto variables = make_latent_variables(hidden.model);
  const FitResult r = fit_observation(hidden.observation, "o", *variables, schedule(), quiet());
  ASSERT_EQ(r.start_mse.size(), 200u);
  const auto skipped = std::count(r.start_mse.begin(), r.start_mse.end(), kNotRolledOut);
  EXPECT_GT(skipped, 120);
  EXPECT_LT(skipped, 190);
  std::set<std::string> seen, all;
  for (int i = 0; i < 200; ++i) {
    all.insert(variables->label(i));
    if (r.start_mse[i] < kNotRolledOut) seen.insert(variables->label(i));
  }
  EXPECT_EQ(seen, all);  // of each material one at least
  EXPECT_EQ(r.ends.front().u, r.u);
  EXPECT_EQ(r.ends.front().start, r.start);
}

TEST(Fit, HorizonsCountFromContact) {
  EXPECT_EQ(horizon_frames(1, 10, 41), 41);
  EXPECT_EQ(horizon_frames(0.5, 11, 41), 26);
  EXPECT_EQ(horizon_frames(0.001, 11, 41), 12);
  EXPECT_EQ(horizon_frames(0.5, 41, 41), 21);  // no contact at all
  EXPECT_EQ(horizon_frames(0.001, 41, 41), 2);
}

TEST(Fit, PicturesAndMetricsOfAResult) {
  const Hidden hidden;
  FitOptions options = schedule();
  options.stages.back().epochs = 3;
  const Inference inference = infer(hidden.observation, "o", *hidden.variables, options, quiet());
  EXPECT_NEAR(inference.fit_mse, inference.fit.mse, 1e-3 * inference.fit.mse + 1e-12);
  EXPECT_NEAR(inference.size, 0.25, 1e-9);
  Metrics metrics;
  add_metrics(metrics, inference, hidden.observation, *hidden.variables);
  for (const auto& [name, value] : metrics.entries()) EXPECT_TRUE(std::isfinite(value)) << name;
  const auto count = roll_outs_to_a_hundredth(inference.fit);
  EXPECT_EQ(count.has_value(), metrics.find("roll_outs_to_a_hundredth").has_value());
  FitResult made;
  made.start_mse = {2e-4, 1e-4};
  made.stages = 2;
  made.history = {{0, 1, 0, 0.1, 1e-9}, {1, 1, 0, 0.2, 2e-6}, {1, 1, 1, 0.2, 1e-6}};
  EXPECT_EQ(roll_outs_to_a_hundredth(made), 3u);  // the first stage does not see all frames
  made.history.pop_back();
  EXPECT_FALSE(roll_outs_to_a_hundredth(made).has_value());
  made.history.resize(1);  // the last stage did nothing
  EXPECT_FALSE(roll_outs_to_a_hundredth(made).has_value());
  EXPECT_EQ(*metrics.find("roll_outs"), static_cast<double>(inference.fit.history.size()));
  const Chart chart = loss_chart(inference.fit, *hidden.variables, "loss");
  std::size_t points = 0;
  for (const Series& s : chart.series) points += s.x.size();
  EXPECT_EQ(chart.series.size(), 4u);
  EXPECT_EQ(points, inference.fit.history.size());
}

}  // namespace
}  // namespace uniphy
