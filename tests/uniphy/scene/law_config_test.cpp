#include "uniphy/scene/law_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/random_weights.hpp"
#include "uniphy/io/latent_file.hpp"
#include "uniphy/io/model_file.hpp"
#include "uniphy/scene/time_step.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

// A folder with model.h5 (3 codes of 4 numbers) and fit/latent.h5.
class LearnedLaw : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              (std::string("uniphy_law_") +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_ / "fit");
    ModelFile model;
    model.weights =
        testing::random_weights(kernels::LawForm::isotropic, 4, 8, 2, kernels::Activation::gelu, 3);
    for (int i = 0; i < 12; ++i) model.latents.push_back(0.01 * i);
    model.materials = {"elastic", "sand", "newtonian"};
    model.parameters.assign(3, no_parameters());
    write_model(folder_ / "model.h5", model);
    fitted_.model = (folder_ / "model.h5").string();
    fitted_.z = {0.1, 0.2, 0.3, 0.4};
    write_latent(folder_ / "fit" / "latent.h5", fitted_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  kernels::LawDescription load(const std::string& keys) const {
    const Config config = Config::parse("law: {type: learned, " + keys + "}");
    Section root = config.root();
    Section law = root.section("law", "");
    const LawSource source = read_law(law);
    config.finish();
    return source.load();
  }
  std::string model_key() const { return "model: " + (folder_ / "model.h5").string(); }
  std::string error_of(const std::string& keys) const {
    try {
      load(keys);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path folder_;
  LatentFile fitted_;
};

TEST(AnalyticLaw, SandHasTheVolumeCorrectionUnlessItSaysOtherwise) {
  const auto id_of = [](const std::string& keys) {
    const Config config = Config::parse("law: {" + keys + "}");
    Section root = config.root();
    Section law = root.section("law", "");
    const LawSource source = read_law(law);
    config.finish();
    return source.load().id;
  };
  const std::string sand = "type: sand, mu: 1e5, lambda: 2e5, theta: 0.3";
  EXPECT_EQ(id_of(sand), kernels::LawId::volume_corrected_sand);
  EXPECT_EQ(id_of(sand + ", volume_correction: true"), kernels::LawId::volume_corrected_sand);
  EXPECT_EQ(id_of(sand + ", volume_correction: false"), kernels::LawId::sand);
  EXPECT_THAT(
      testing::error_of([&] { id_of("type: volume_corrected_sand, mu: 1, lambda: 1, theta: 1"); }),
      HasSubstr("volume_corrected_sand"));
}

TEST_F(LearnedLaw, TakesACodeOfTheModel) {
  const auto law = load(model_key() + ", latent: {type: code, index: 2}");
  EXPECT_EQ(law.id, kernels::LawId::learned);
  EXPECT_EQ(law.z, (std::vector<double>{0.08, 0.09, 0.10, 0.11}));
  EXPECT_EQ(load(model_key()).z[3], 0.03) << "the first code by default";
  EXPECT_THAT(error_of(model_key() + ", latent: {type: code, index: 3}"),
              HasSubstr("latent.index: expected 0 to 2, the codes of the model, found 3"));
}

TEST_F(LearnedLaw, TakesNumbers) {
  EXPECT_EQ(load(model_key() + ", latent: {type: values, z: [1, 2, 3, 4]}").z[2], 3);
  EXPECT_THAT(
      error_of(model_key() + ", latent: {type: values, z: [1, 2]}"),
      HasSubstr("expected a latent code of 4 numbers, the size that the model has, found 2"));
}

TEST_F(LearnedLaw, TakesAFittedLatentFromItsFileOrFolder) {
  const std::string fit = (folder_ / "fit").string();
  EXPECT_EQ(load("latent: {type: fitted, path: " + fit + "}").z, fitted_.z);
  EXPECT_EQ(load("latent: {type: fitted, path: " + fit + "/latent.h5}").z, fitted_.z);
  EXPECT_THAT(error_of("latent: {type: fitted, path: " + fit + "/missing.h5}"),
              HasSubstr("missing.h5"));
}

TEST_F(LearnedLaw, SaysWhereItComesFrom) {
  ModelFile model = read_model(folder_ / "model.h5");
  model.training_dt = {1e-4, 2e-4};
  write_model(folder_ / "model.h5", model);
  fitted_.dt = 5e-4;
  fitted_.determined = false;
  write_latent(folder_ / "fit" / "latent.h5", fitted_);
  const auto origin_of = [&](const std::string& keys) {
    const Config config = Config::parse("law: {type: learned, " + keys + "}");
    Section root = config.root();
    Section law = root.section("law", "");
    LawOrigin origin;
    read_law(law).load(&origin);
    return origin;
  };
  const LawOrigin code = origin_of(model_key());
  EXPECT_EQ(code.kind, LawOrigin::Kind::trained);
  EXPECT_EQ(code.dt, (std::array<double, 2>{1e-4, 2e-4}));
  EXPECT_TRUE(code.determined);
  const LawOrigin fit =
      origin_of("latent: {type: fitted, path: " + (folder_ / "fit").string() + "}");
  EXPECT_EQ(fit.kind, LawOrigin::Kind::fitted);
  EXPECT_EQ(fit.dt, (std::array<double, 2>{5e-4, 5e-4}));
  EXPECT_FALSE(fit.determined);
}

TEST_F(LearnedLaw, FindsTheModelBesideTheLatentFile) {
  fitted_.model = "moved/away.h5";
  write_latent(folder_ / "fit" / "latent.h5", fitted_);
  EXPECT_THAT(error_of("latent: {type: fitted, path: " + (folder_ / "fit").string() + "}"),
              HasSubstr("its model \"moved/away.h5\" was not found"));
  std::filesystem::copy_file(folder_ / "model.h5", folder_ / "fit" / "model.h5");
  EXPECT_EQ(load_fitted_law(folder_ / "fit").z, fitted_.z);
}

TEST_F(LearnedLaw, FittedLatentOfAnotherSizeIsRefused) {
  fitted_.z = {1, 2};
  write_latent(folder_ / "fit" / "latent.h5", fitted_);
  EXPECT_THAT(error_of("latent: {type: fitted, path: " + (folder_ / "fit").string() + "}"),
              HasSubstr("expected a latent code of 4 numbers"));
}

TEST_F(LearnedLaw, FittedAnalyticLawsNeedNoModel) {
  LatentFile fitted;
  fitted.law = "sand";
  fitted.analytic.id = kernels::LawId::sand;
  fitted.analytic.mu = 1e5;
  fitted.analytic.lambda = 2e5;
  fitted.analytic.theta = 0.3;
  write_latent(folder_ / "fit" / "latent.h5", fitted);
  const auto law = load_fitted_law(folder_ / "fit");
  EXPECT_EQ(law.id, kernels::LawId::sand);
  EXPECT_EQ(law.theta, 0.3);
}

TEST_F(LearnedLaw, HasAStiffnessThatScalesWithItsStressScale) {
  auto law = load(model_key());
  law.z = {0, 0, 0, 0};
  const Stiffness soft = estimate_stiffness(law);
  EXPECT_GT(soft.wave_modulus, 0);
  EXPECT_GT(soft.viscosity, 0);
  // The first coordinate of z carries the stress scale but also enters the networks, whose weights
  // for it are cleared here.
  auto weights = *law.weights;
  auto& layer = weights.stress.layers.front();
  for (int row = 0; row < layer.out; ++row) layer.weight[row * layer.in + layer.in - 4] = 0;
  auto& gate = weights.projection.layers.front();
  for (int row = 0; row < gate.out; ++row) gate.weight[row * gate.in + gate.in - 4] = 0;
  law.weights = std::make_shared<kernels::LearnedLawWeights>(weights);
  const double before = estimate_stiffness(law).wave_modulus;
  law.z[0] = std::log(10.0) / kernels::kStressRate;
  EXPECT_NEAR(estimate_stiffness(law).wave_modulus, 10 * before, 1e-6 * before);
}

}  // namespace
}  // namespace uniphy
