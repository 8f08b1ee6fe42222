// uniphy_stability from the configuration to the files, at a tiny size.

#include "uniphy/stability/stability_stage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/uniphy/stability/stability_cases.hpp"
#include "tests/uniphy/support/scratch.hpp"

namespace uniphy::stability {
namespace {

using ::testing::HasSubstr;
using ::uniphy::testing::error_of;

std::string small(const std::string& more) {
  return "quick: true\nmodel: " + testing::shipped_model() +
         "\nspectral: {states: 60}\nrollout: {steps: 40, per_side: 4, drawn: 1}\n"
         "horizons: {steps: [20]}\nprecision: {steps: 40}\n" +
         more;
}

Metrics run(const std::string& yaml, const std::filesystem::path& directory, int threads = 2) {
  const Config config = Config::parse(yaml, "config.yaml");
  Section root = config.root();
  const RunFunction work = stability_stage(root);
  config.finish();
  make_directory(directory);
  return testing::on_threads(threads, [&] {
    RunDirectory out(directory, config.resolved(), threads);
    Metrics metrics;
    work(out, metrics);
    return metrics;
  });
}

TEST(StabilityStage, OursSurvivesTheSpectralRowsAndTheReferencesDoNot) {
  const testing::Scratch scratch;
  const Metrics m = run(small("stressors: [spectral]\n"), scratch.file("out"));
  for (const char* row : {"equal_values", "near_equal_values", "at_rest", "rotation",
                          "near_rotation", "rank_loss", "inverted", "random_states"}) {
    for (const char* method : {"analytic", "isotropic", "exported"}) {
      const std::string name = std::string(row) + "." + method;
      EXPECT_EQ(m.find("survives." + name), 1) << name;
      EXPECT_LE(*m.find("gradient_error." + name), 1e-5) << name;
    }
  }
  EXPECT_EQ(m.find("gradient_finite_share"), 1);
  EXPECT_LE(*m.find("gradient_error.rotation.analytic"), 1e-9);
  for (const char* name :
       {"at_rest.raw_svd", "at_rest.clamped_svd", "at_rest.nan_to_zero", "equal_values.raw_svd",
        "rotation.clamped_svd", "near_rotation.clamped_svd", "at_rest.published"})
    EXPECT_LT(*m.find(std::string("survives.") + name), 1) << name;
  EXPECT_GT(*m.find("gradient_error.rotation.clamped_svd"), 0.8);
  EXPECT_EQ(m.find("gradient_error.at_rest.nan_to_zero"), 1);
  EXPECT_LT(*m.find("gradient_finite_share.raw_svd"), 1);
}

TEST(StabilityStage, RollsOutEveryStressorAndResumes) {
  const testing::Scratch scratch;
  const std::string yaml = small("stressors: [time_step, impacts, latents, horizons, precision]\n");
  const auto out = scratch.file("out");
  const Metrics first = run(yaml, out);
  for (const char* name :
       {"time_step.analytic", "time_step.isotropic", "stiffness.analytic", "viscosity.analytic",
        "impact_wall.analytic", "impact_corner.isotropic", "collision.analytic", "pushed.isotropic",
        "light_body.analytic", "codes_interpolated.isotropic", "horizons.analytic",
        "horizons.isotropic", "precision.analytic", "precision.isotropic", "dissipation.analytic"})
    EXPECT_EQ(first.find(std::string("survives.") + name), 1) << name;
  EXPECT_LT(*first.find("survives.stiffness.unchecked_step"), 1);
  EXPECT_LT(*first.find("survives.viscosity.unchecked_step"), 1);
  EXPECT_EQ(first.find("survives.light_body.mass_epsilon"), 0);
  EXPECT_THAT(read_text_file(out / "stability.md"), HasSubstr("| time_step |"));
  EXPECT_THAT(read_text_file(out / "failures.csv"), HasSubstr("unchecked_step,stiffness"));
  EXPECT_THAT(read_text_file(out / "stability.csv"), HasSubstr("adjoint_growth"));

  const std::string csv = read_text_file(out / "stability.csv");
  EXPECT_EQ(run(yaml, out).json(), first.json());
  EXPECT_EQ(read_text_file(out / "stability.csv"), csv);
}

TEST(StabilityStage, HasTheSameBitsOnAnyNumberOfThreads) {
  const testing::Scratch scratch;
  const std::string yaml = small("stressors: [spectral, horizons, precision]\n");
  const Metrics one = run(yaml, scratch.file("one"), 1);
  EXPECT_EQ(run(yaml, scratch.file("two"), 2).json(), one.json());
  EXPECT_EQ(read_text_file(scratch.file("one") / "stability.csv"),
            read_text_file(scratch.file("two") / "stability.csv"));
}

TEST(StabilityStage, RefusesBadKeys) {
  const testing::Scratch scratch;
  const auto declared = [&](const std::string& more) {
    return error_of([&] { run(small(more), scratch.file("out")); });
  };
  EXPECT_THAT(declared("stressors: [spectral, weather]\n"), HasSubstr("weather"));
  EXPECT_THAT(declared("methods: [hope]\n"), HasSubstr("hope"));
  EXPECT_THAT(declared("seeds: 1\n"), HasSubstr("seeds"));
  EXPECT_THAT(error_of([&] { run("model: nowhere.h5\n", scratch.file("out")); }),
              HasSubstr("nowhere.h5"));
}

TEST(StabilityStage, TheShippedConfigurationIsRead) {
  for (const char* quick : {"quick=true", "quick=false"}) {
    const Config config =
        Config::load(std::filesystem::path(UNIPHY_SOURCE_DIR) / "configs/stability/stability.yaml",
                     {"model=" + testing::shipped_model(), quick});
    Section root = config.root();
    stability_stage(root);
    EXPECT_NO_THROW(config.finish());
  }
}

}  // namespace
}  // namespace uniphy::stability
