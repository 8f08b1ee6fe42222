// What inference refuses: observations, states of interrupted fits, latent files, configurations.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/identify/identify.hpp"
#include "uniphy/inference/infer_run.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

FitOptions one_stage() {
  FitOptions options;
  options.stages = {{1, 1, 1, "lbfgs", 0.1}};
  return options;
}

struct BadObservation {
  const char* name;
  std::function<void(Observation&)> spoil;
  const char* message;
};
std::ostream& operator<<(std::ostream& out, const BadObservation& b) { return out << b.name; }

class BadObservations : public ::testing::TestWithParam<BadObservation> {};

/// From the file to the first roll-out, as uniphy_infer does it.
TEST_P(BadObservations, AreRefused) {
  testing::ObservedScene scene;
  scene.side = 3;
  scene.frames = 4;
  Observation o = testing::observe(testing::elastic_body(), scene);
  GetParam().spoil(o);
  const auto variables =
      make_analytic_variables(kernels::LawId::elastic, {{1e4, 2e4}, {1e4, 2e4}}, 2, 1);
  const testing::Scratch scratch;
  const std::string file = scratch.file("seen.h5").string();
  const std::string message = testing::error_of([&] {
    write_observation(file, o);
    FitHooks hooks;
    hooks.progress = false;
    fit_observation(read_observation(file), file, *variables, one_stage(), hooks);
  });
  EXPECT_THAT(message, HasSubstr("seen.h5: "));
  EXPECT_THAT(message, HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Cases, BadObservations,
    ::testing::Values(
        BadObservation{"SingleFrame",
                       [](Observation& o) {
                         o.frames = 1;
                         o.x.resize(3 * o.particles);
                         o.time.resize(1);
                       },
                       "expected at least two frames"},
        BadObservation{"NotFinite",
                       [](Observation& o) { o.x[5] = std::numeric_limits<double>::quiet_NaN(); },
                       "x"},
        BadObservation{"TimesGoBack", [](Observation& o) { o.time[2] = o.time[1]; },
                       "expected increasing times"},
        BadObservation{"HiddenInTheFirstFrame",
                       [](Observation& o) { o.x[3] = o.x[4] = o.x[5] = std::nan(""); },
                       "expected every particle in the first frame, found NaN of point 1"},
        BadObservation{"HalfHidden",
                       [](Observation& o) { o.x[3 * o.particles + 1] = std::nan(""); },
                       "expected three coordinates, or NaN in all of them, found both of point 0 "
                       "in frame 1"},
        BadObservation{"NoiseOfTheSceneItself", [](Observation& o) { o.noise = 2; },
                       "attribute noise of /x: expected 0 to 1 m, found 2"},
        BadObservation{"TracersWithoutABody",
                       [](Observation& o) {
                         o.tracers.assign(o.x.begin(), o.x.begin() + 3 * o.particles);
                         o.particles = 0;
                         o.volume.clear();
                       },
                       "expected at least one particle, found none"},
        BadObservation{"ATriangleOfNoVertex",
                       [](Observation& o) {
                         o.tracers.assign(o.x.begin(), o.x.begin() + 3 * o.particles);
                         o.vertices.assign(9, 0.5);
                         o.triangles = {0, 1, 3};
                       },
                       "/body/triangles: expected vertices 0 to 2, found 3 in triangle 0"},
        BadObservation{"NoVolume", [](Observation& o) { o.volume[4] = 0; }, "expected volumes > 0"},
        BadObservation{"UnknownWalls", [](Observation& o) { o.walls = "sticky"; },
                       "expected \"freeslip\" or \"noslip\""},
        BadObservation{"NoTimeStep", [](Observation& o) { o.dt = 0; }, "expected a time step"},
        BadObservation{"ThickWalls", [](Observation& o) { o.bound = 9; }, "attribute bound"},
        BadObservation{"NoDensity", [](Observation& o) { o.density = -1; }, "expected a density"},
        BadObservation{"ManyStepsAway", [](Observation& o) { o.time[3] = 1e9; },
                       "expected at most 10000000 time steps"}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(BadObservationPlace, ABodyOutsideTheGridIsRefusedWithItsParticle) {
  testing::ObservedScene scene;
  scene.side = 3;
  scene.frames = 4;
  Observation o = testing::observe(testing::elastic_body(), scene);
  for (double& x : o.x) x += 0.6;
  const auto variables =
      make_analytic_variables(kernels::LawId::elastic, {{1e4, 2e4}, {1e4, 2e4}}, 2, 1);
  FitHooks hooks;
  hooks.progress = false;
  EXPECT_THAT(
      testing::error_of([&] { fit_observation(o, "seen.h5", *variables, one_stage(), hooks); }),
      HasSubstr("particle"));
}

struct Interrupted {
  testing::Scratch scratch;
  Observation observation;
  std::unique_ptr<const FitVariables> variables;
  FitHooks hooks;

  Interrupted() {
    testing::ObservedScene scene;
    scene.side = 3;
    scene.frames = 21;
    observation = testing::observe(testing::elastic_body(), scene);
    variables = make_analytic_variables(kernels::LawId::elastic, {{1e4, 2e4}, {1e4, 2e4}}, 2, 1);
    hooks.progress = false;
    hooks.save_seconds = 0;
    hooks.state_file = scratch.file("state.h5");
    hooks.fingerprint = "abc";
    run();
  }
  void run() { fit_observation(observation, "seen.h5", *variables, one_stage(), hooks); }
};

TEST(BadState, OfAnotherFitIsRefused) {
  Interrupted fit;
  fit.hooks.fingerprint = "abd";
  EXPECT_THAT(testing::error_of([&] { fit.run(); }),
              HasSubstr("state.h5: attribute fingerprint of /: expected abd, found abc"));
}

TEST(BadState, ThatIsNoStateIsRefused) {
  Interrupted fit;
  fit.scratch.write("state.h5", "not HDF5");
  EXPECT_THAT(testing::error_of([&] { fit.run(); }), HasSubstr("state.h5"));
  write_observation(fit.hooks.state_file, fit.observation);
  EXPECT_THAT(testing::error_of([&] { fit.run(); }), HasSubstr("uniphy-fit-state"));
}

// What a full disk left once: zeros in the candidates, taken up again as another material.
TEST(BadState, ThatLostItsNumbersIsRefused) {
  Interrupted fit;
  const FitState good = read_fit_state(fit.hooks.state_file, "abc");
  const double loss = good.candidates[0].loss;
  std::string bytes = read_text_file(fit.hooks.state_file);
  const std::size_t at = bytes.find(std::string(reinterpret_cast<const char*>(&loss), sizeof loss));
  ASSERT_NE(at, bytes.npos);
  bytes.replace(at, 64, 64, '\0');
  fit.scratch.write("state.h5", bytes);
  EXPECT_THAT(testing::error_of([&] { fit.run(); }), HasSubstr("its checksum does not fit"));
}

TEST(BadState, WithANumberOutOfPlaceIsRefused) {
  Interrupted fit;
  const FitState good = read_fit_state(fit.hooks.state_file, "abc");
  const auto refused = [&](const std::function<void(FitState&)>& spoil, const char* message) {
    FitState bad = good;
    spoil(bad);
    write_fit_state(fit.hooks.state_file, bad, "abc");
    EXPECT_THAT(testing::error_of([&] { fit.run(); }), HasSubstr(message));
  };
  refused([](FitState& s) { s.stage = 7; }, "stage out of range");
  refused([](FitState& s) { s.start_mse.pop_back(); }, "expected one loss a start and stage");
  refused([](FitState& s) { s.candidates.clear(); }, "expected candidates, found none");
  refused([](FitState& s) { s.candidates[0].start = 5; }, "does not fit the model");
  refused(
      [](FitState& s) {
        s.stage = 0;
        s.steps = 1;
        s.candidates[0].optimizer = "damaged";
      },
      "state.h5: state of the optimizer: ");
}

TEST(Fingerprint, SeesEverythingThatAFitDependsOn) {
  const Observation o = testing::observe(testing::elastic_body());
  const ModelFile model = testing::readable_model();
  const auto of = [](const Observation& seen, const ModelFile& m, const std::string& text) {
    return fit_fingerprint(seen, *make_latent_variables(m), text);
  };
  const std::string before = of(o, model, "a");
  EXPECT_EQ(before, of(o, model, "a"));
  EXPECT_NE(before, of(o, model, "b"));
  Observation moved = o;
  moved.x.back() += 1e-15;
  EXPECT_NE(before, of(moved, model, "a"));
  Observation lighter = o;
  lighter.density = 999;
  EXPECT_NE(before, of(lighter, model, "a"));
  ModelFile trained = model;
  trained.weights.stress.layers[0].bias[0] += 1e-9;
  EXPECT_NE(before, of(o, trained, "a"));
}

TEST(LatentFileTest, ReadsBack) {
  LatentFile latent;
  latent.model = "models/some.h5";
  latent.z = {0.1, -2, 3};
  latent.linear = {1, 2, 3};
  latent.centre = {0.5, 0.25, 0.125};
  latent.history = {{0, 4, 2, 0.1, 1e-5}, {1, 4, 0, 0.2, std::numeric_limits<double>::infinity()}};
  latent.nearest = {{4, 0.5, "sand"}};
  latent.config = "a: 1\n";
  latent.dt = 4e-4;
  latent.determined = false;
  const testing::Scratch scratch;
  write_latent(scratch.file("l.h5"), latent);
  const LatentFile read = read_latent(scratch.file("l.h5"));
  EXPECT_EQ(read.law, "learned");
  EXPECT_EQ(read.model, latent.model);
  EXPECT_EQ(read.z, latent.z);
  EXPECT_EQ(read.linear, latent.linear);
  EXPECT_EQ(read.centre, latent.centre);
  EXPECT_EQ(read.config, latent.config);
  EXPECT_EQ(read.dt, latent.dt);
  EXPECT_FALSE(read.determined);
  ASSERT_EQ(read.history.size(), 2u);
  EXPECT_EQ(read.history[0].epoch, 2);
  EXPECT_TRUE(std::isinf(read.history[1].mse));
  ASSERT_EQ(read.nearest.size(), 1u);
  EXPECT_EQ(read.nearest[0].material, "sand");

  LatentFile sand;
  sand.law = "sand";
  sand.analytic.id = kernels::LawId::sand;
  sand.analytic.mu = 1e5;
  sand.analytic.lambda = 2e5;
  sand.analytic.theta = 0.3;
  write_latent(scratch.file("s.h5"), sand);
  const LatentFile back = read_latent(scratch.file("s.h5"));
  EXPECT_EQ(back.analytic.id, kernels::LawId::sand);
  EXPECT_EQ(back.analytic.theta, 0.3);
  EXPECT_EQ(back.analytic.eta, 0);
  EXPECT_EQ(back.dt, 0);  // not known
  EXPECT_TRUE(back.determined);
}

TEST(LatentFileTest, WhatIsMissingIsNamed) {
  const testing::Scratch scratch;
  const auto refused = [&](const std::function<void(hdf5::Writer&)>& fill, const char* message) {
    {
      hdf5::Writer writer(scratch.file("l.h5"));
      writer.attribute("/", "format", "uniphy-latent");
      writer.attribute("/", "version", 1);
      writer.attribute("/", "config", "");
      fill(writer);
      writer.commit();
    }
    EXPECT_THAT(testing::error_of([&] { read_latent(scratch.file("l.h5")); }), HasSubstr(message));
  };
  refused([](hdf5::Writer& w) { w.attribute("/", "law", "jelly"); }, "\"jelly\"");
  refused(
      [](hdf5::Writer& w) {
        w.attribute("/", "law", "learned");
        w.attribute("/", "model", "m.h5");
      },
      "z");
  refused(
      [](hdf5::Writer& w) {
        w.attribute("/", "law", "elastic");
        w.write<double>("parameters", {1, std::numeric_limits<double>::quiet_NaN(), 0, 0, 0}, {5},
                        {"Pa", ""});
      },
      "expected lambda >= 0");
  refused(
      [](hdf5::Writer& w) {
        w.attribute("/", "law", "elastic");
        w.attribute("/", "dt", -1e-4);
      },
      "l.h5: attribute dt of /: expected a time step");
}

struct BadConfig {
  const char* name;
  const char* yaml;
  const char* message;
};
std::ostream& operator<<(std::ostream& out, const BadConfig& b) { return out << b.name; }

class BadFitConfigs : public ::testing::TestWithParam<BadConfig> {};

TEST_P(BadFitConfigs, AreRefused) {
  EXPECT_THAT(testing::error_of([&] {
                Config config = Config::parse(GetParam().yaml, "infer.yaml");
                Section root = config.root();
                read_fit_variables(root);
                read_fit_options(root);
                config.finish();
              }),
              HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Cases, BadFitConfigs,
    ::testing::Values(
        BadConfig{"ListsOfDifferentLength", "schedule: {horizon: [0.5, 1], candidates: [2]}",
                  "expected lists of one length in horizon, candidates and epochs"},
        BadConfig{"LastHorizonShort", "schedule: {horizon: [0.2, 0.4, 0.8]}",
                  "expected 1 in the last stage, found 0.8"},
        BadConfig{"HorizonOutOfRange", "schedule: {horizon: [0, 0.5, 1]}", "schedule.horizon"},
        BadConfig{"UnknownOptimizer", "schedule: {optimizer: newton}", "schedule.optimizer"},
        BadConfig{"UnknownRollout", "rollout: fast", "rollout"},
        BadConfig{"UnknownPrecision", "dtype: float16", "dtype"},
        BadConfig{"UnknownLaw", "law: {type: jelly}", "law.type"},
        BadConfig{"RangeUpsideDown", "law: {type: elastic, mu: [2, 1]}", "law.mu"},
        BadConfig{"ParameterOfAnotherLaw", "law: {type: elastic, theta: [0.1, 0.2]}", "theta"},
        BadConfig{"UnknownKey", "shedule: {rate: 1}", "shedule"}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(FitVariables, AModelWithoutCodesIsRefused) {
  ModelFile model = testing::readable_model();
  model.latents.clear();
  model.materials.clear();
  EXPECT_THAT(testing::error_of([&] { make_latent_variables(model); }),
              HasSubstr("expected latent codes to start from"));
}

TEST(HiddenCases, AreTheSameForASeedAndNeverOfTrainingShapes) {
  Config config = Config::parse("scene: {steps: 240, particles: 60}", "identify.yaml");
  Section root = config.root();
  const IdentifyOptions options = read_identify_options(root);
  for (std::int64_t m = 0; m < 5; ++m) {
    const HiddenCase hidden = draw_hidden_case(options.hidden, m);
    EXPECT_EQ(hidden.observed.record.material, options.hidden.draw.materials[m].name());
    EXPECT_EQ(hidden.observed_truth.x, draw_hidden_case(options.hidden, m).observed_truth.x);
    EXPECT_NE(hidden.observed.record.shape, hidden.other.record.shape);
    EXPECT_EQ(*hidden.other.scene.dt, *options.hidden.draw.dt);
    const BodyDescription &a = hidden.observed.scene.bodies[0], &b = hidden.other.scene.bodies[0];
    EXPECT_GT((a.velocity - b.velocity).norm(), 1e-3);
    EXPECT_EQ(a.law.mu, b.law.mu);
    for (const char* shape : {"box", "sphere", "cylinder", "torus", "ellipsoid"}) {
      EXPECT_NE(hidden.observed.record.shape, shape);
    }
  }
}

}  // namespace
}  // namespace uniphy
