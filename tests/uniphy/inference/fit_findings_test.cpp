#include "uniphy/inference/fit_findings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "ops/kernels/laws/law_parameters.hpp"
#include "tests/support/published_return.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

FitOptions short_schedule() {
  FitOptions options;
  options.dtype = "float64";
  options.stages = {{1, 2, 12, "lbfgs", 0.1}};
  return options;
}

Inference fitted(const Observation& o, const FitVariables& variables) {
  FitHooks hooks;
  hooks.progress = false;
  return infer(o, "o", variables, short_schedule(), hooks);
}

std::unique_ptr<const FitVariables> elastic_variables(std::array<double, 2> mu,
                                                      std::array<double, 2> lambda) {
  return make_analytic_variables(kernels::LawId::elastic, {mu, lambda}, 6, 1);
}

Observation in_flight() {
  testing::ObservedScene scene;
  scene.motion = {{0.5, 0.5, 0.5}, {0.3, 0, 0}, {0, 0, 0}};
  scene.frames = 11;
  return testing::observe(testing::elastic_body(1e5, 2e5), scene);
}

TEST(FitFindings, AContactThatTellsNothingNamesNoMaterial) {
  const Observation whole = testing::observe(testing::elastic_body());
  Observation o = first_frames(whole, 16);
  o.noise = 0.3;  // as large as the body
  const auto variables = elastic_variables({1e3, 1e6}, {1e3, 1e6});
  const Inference found = fitted(o, *variables);
  ASSERT_LT(found.fit.contact, o.frames);
  EXPECT_FALSE(found.fit.determined);
  EXPECT_THAT(fit_warnings(found, o, *variables),
              ::testing::Contains(HasSubstr("determines none of the 2 numbers")));
  Metrics metrics;
  add_metrics(metrics, found, o, *variables);
  EXPECT_EQ(metrics.find("contact"), 1);
  EXPECT_EQ(metrics.find("determined"), 0);
  EXPECT_EQ(metrics.find("directions"), 2);
  EXPECT_EQ(metrics.find("directions_determined"), 0);
  EXPECT_EQ(metrics.find("reading.mu"), std::nullopt);
}

TEST(FitFindings, FreeFlightNamesNoMaterial) {
  const Observation o = in_flight();
  const auto analytic = elastic_variables({1e3, 1e6}, {1e3, 1e6});
  const auto latent = make_latent_variables(testing::readable_model());
  for (const FitVariables* variables : {analytic.get(), latent.get()}) {
    const Inference found = fitted(o, *variables);
    EXPECT_FALSE(found.fit.determined);
    EXPECT_THAT(fit_warnings(found, o, *variables),
                ElementsAre(HasSubstr("no wall acted before the last frame")));
    const std::string summary = fit_summary(found.fit, *variables);
    EXPECT_THAT(summary, HasSubstr("not determined"));
    EXPECT_THAT(summary, AllOf(Not(HasSubstr("elastic")), Not(HasSubstr("plasticine")),
                               Not(HasSubstr("mu"))));
    Metrics metrics;
    add_metrics(metrics, found, o, *variables);
    EXPECT_EQ(metrics.find("contact"), 0);
    for (const auto& [name, value] : metrics.entries()) {
      EXPECT_THAT(name, AllOf(Not(HasSubstr("parameter")), Not(HasSubstr("nearest"))));
    }
    const LatentFile file = latent_of(found, o, *variables, "model.h5", "");
    EXPECT_FALSE(file.determined);
    EXPECT_THAT(file.nearest, IsEmpty());
    for (const Series& line : loss_chart(found.fit, *variables, "loss").series) {
      EXPECT_THAT(line.label, Not(HasSubstr("(")));
    }
    const testing::Scratch scratch;
    write_latent(scratch.file("l.h5"), file);
    EXPECT_FALSE(read_latent(scratch.file("l.h5")).determined);
  }
}

TEST(FitFindings, AWallDeterminesTheMaterial) {
  const Observation o = testing::observe(testing::elastic_body(2e4, 3e4));
  const auto variables = elastic_variables({1e4, 4e4}, {1e4, 1e5});
  const Inference found = fitted(o, *variables);
  EXPECT_THAT(fit_warnings(found, o, *variables), IsEmpty());
  EXPECT_THAT(fit_summary(found.fit, *variables),
              AllOf(HasSubstr("mu 2"), HasSubstr("in [10000, 40000]"), HasSubstr("near start")));
  Metrics metrics;
  add_metrics(metrics, found, o, *variables);
  EXPECT_EQ(metrics.find("contact"), 1);
  EXPECT_EQ(metrics.find("outside_range.mu"), 0);
  EXPECT_LT(*metrics.find("start_residual_over_size"), *metrics.find("start_allowed_over_size"));
  const LatentFile file = latent_of(found, o, *variables, "", "");
  EXPECT_TRUE(file.determined);
  EXPECT_EQ(file.dt, o.dt);
}

TEST(FitFindings, ARangeOfOneValueIsAConstant) {
  const auto variables = elastic_variables({2.5e4, 2.5e4}, {1e4, 1e5});
  EXPECT_EQ(variables->size(), 1);
  const Observation o = testing::observe(testing::elastic_body(2e4, 3e4));
  const Inference found = fitted(o, *variables);
  EXPECT_EQ(found.fit.law.mu, 2.5e4);
  EXPECT_EQ(found.fit.u.size(), 1u);
  EXPECT_LT(found.fit.mse, found.best_start);
  EXPECT_THAT(fit_summary(found.fit, *variables), HasSubstr("mu 25000 Pa, a constant\n"));
  EXPECT_THAT(testing::error_of([] {
                elastic_variables({1e5, 1e5}, {2e5, 2e5});
              }),
              HasSubstr("expected a parameter with a range of more than one value"));
}

TEST(FitFindings, ConstantsAloneAreAnErrorOfTheConfiguration) {
  const Config config = Config::parse("law: {type: elastic, mu: [1e5, 1e5], lambda: [2e5, 2e5]}");
  Section root = config.root();
  EXPECT_THAT(testing::error_of([&] { read_fit_variables(root); }),
              AllOf(HasSubstr("law.mu"), HasSubstr("found constants")));
}

TEST(FitFindings, AResultOutsideOfItsRangeIsMarked) {
  const Observation o = testing::observe(testing::elastic_body(2e4, 3e4));
  const auto variables = elastic_variables({3e4, 6e4}, {1e4, 1e5});
  const Inference found = fitted(o, *variables);
  ASSERT_LT(found.fit.law.mu, 2.9e4);
  EXPECT_THAT(fit_warnings(found, o, *variables),
              ElementsAre(AllOf(HasSubstr("law.mu"), HasSubstr("outside of its range"))));
  EXPECT_THAT(fit_summary(found.fit, *variables), HasSubstr("OUTSIDE of [30000, 60000]"));
  Metrics metrics;
  add_metrics(metrics, found, o, *variables);
  EXPECT_EQ(metrics.find("outside_range.mu"), 1);
  EXPECT_EQ(metrics.find("outside_range.lambda"), 0);
}

TEST(FitFindings, DustIsNamedWithTheNumberToAskFor) {
  testing::ObservedScene scene;
  scene.side = 4;  // 64 particles in 4.8³ cells
  const Observation o = testing::observe(testing::elastic_body(2e4, 3e4), scene);
  const auto variables = elastic_variables({1e4, 4e4}, {1e4, 1e5});
  EXPECT_THAT(
      fit_warnings(fitted(o, *variables), o, *variables),
      ::testing::Contains(AllOf(HasSubstr("64 particles"), HasSubstr("expected at least 111"))));
}

TEST(FitFindings, CloudsThatAreTooSparseAreNamed) {
  Inference made;
  made.fit.determined = false;
  made.check.size = 0.3;
  made.check.noise = 0.06;
  Observation o = testing::observe(testing::elastic_body());
  const auto variables = elastic_variables({1e3, 1e6}, {1e3, 1e6});
  o.cloud = o.particles;
  EXPECT_THAT(fit_warnings(made, o, *variables),
              ::testing::Contains(HasSubstr("20 % of the size away from the body in its place")));
  made.check.noise = 0.02;
  EXPECT_THAT(fit_warnings(made, o, *variables),
              Not(::testing::Contains(HasSubstr("away from the body"))));
}

TEST(FitFindings, AStartOfAHigherDegreeIsNamedWhereOneIsLeft) {
  Inference made;
  made.fit.determined = false;
  made.explained = false;
  made.check.size = 0.3;
  made.misfit.time = {0, 1};
  made.misfit.root = {0, 0};
  Observation o = testing::observe(testing::elastic_body());
  made.seen = o;
  const auto variables = elastic_variables({1e3, 1e6}, {1e3, 1e6});
  const auto named = [&](int degree) {
    o.start_degree = degree;
    for (const std::string& warning : fit_warnings(made, o, *variables)) {
      if (warning.find("start_degree 3 may leave less") != std::string::npos) return true;
    }
    return false;
  };
  EXPECT_FALSE(named(0));
  EXPECT_TRUE(named(2));
  EXPECT_FALSE(named(3));
}

TEST(FitFindings, ALargeMisfitIsNamed) {
  const Observation o = testing::observe(testing::elastic_body(2e4, 3e4));
  const auto variables = elastic_variables({1e4, 4e4}, {1e4, 1e5});
  Inference found = fitted(o, *variables);
  found.fit_mse = std::pow(0.02 * found.size, 2);
  EXPECT_THAT(fit_warnings(found, o, *variables),
              ElementsAre(HasSubstr("misses the positions by 2 % of the size")));
  found.check.noise = 0.012 * found.size;  // explains it
  EXPECT_THAT(fit_warnings(found, o, *variables), IsEmpty());
}

TEST(FitFindings, ACodeThatFlowsByStepsAtAnotherTimeStep) {
  ModelFile model = testing::readable_model();
  model.training_dt = {2e-4, 2e-4};
  const Observation o = testing::observe(testing::elastic_body(2e4, 3e4));  // at 5e-4 s
  const auto warnings = [&](const ModelFile& file) {
    const auto variables = make_latent_variables(file);
    Inference found;
    found.size = found.check.size = 0.25;
    found.fit.law = variables->law(variables->start(1));
    found.fit.u = variables->start(1);
    return fit_warnings(found, o, *variables);
  };
  EXPECT_THAT(warnings(model), IsEmpty());  // the isotropic form knows the time step
  model.weights = testing::published_return(0.1, model.weights.latent_size);
  EXPECT_THAT(warnings(model),
              ElementsAre(AllOf(HasSubstr("trained at a time step of 0.0002 s"),
                                HasSubstr("here dt is 0.0005 s"), HasSubstr("2.5 times"))));
  model.training_dt = {1e-4, 5e-4};
  EXPECT_THAT(warnings(model), IsEmpty());
  model.training_dt = {};  // an older file
  EXPECT_THAT(warnings(model), IsEmpty());
}

}  // namespace
}  // namespace uniphy
