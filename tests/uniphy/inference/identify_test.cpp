#include "uniphy/identify/identify.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/identify/identify_table.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/observation.hpp"
#include "uniphy/io/trajectory.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

IdentifyOptions small_job(const testing::Scratch& scratch) {
  write_model(scratch.file("model.h5"), testing::readable_model());
  const Config config =
      Config::parse("law: {type: learned, model: " + scratch.file("model.h5").string() +
                    "}\n"
                    "materials: [elastic, plasticine]\n"
                    "scene: {grid: 16, dt: 2.5e-4, steps: 240, particles: 200, shapes: [box, "
                    "sphere], size: [0.3, 0.32], "
                    "speed: [3, 4], gap: [0, 0.01]}\n"
                    "observed: {points: 0.2, every: 4, noise: 0.002}\n"
                    "adaptation: {rungs: [latent], samples: 8, iterations: 2}\n"
                    "fit: {schedule: {horizon: [1], candidates: [2], epochs: [3]}}\n");
  Section root = config.root();
  IdentifyOptions options = read_identify_options(root);
  config.finish();
  return options;
}

Metrics run(const IdentifyOptions& options, const std::filesystem::path& directory,
            const std::string& yaml) {
  make_directory(directory);
  RunDirectory out(directory, yaml, 1);
  Metrics metrics;
  identify(options, out, metrics);
  return metrics;
}

bool is_cost(const std::string& name) {
  return name.rfind("seconds", 0) == 0 || name.rfind("memory_mb", 0) == 0;
}

TEST(Identify, AnInterruptedRunGoesOnWithTheCasesThatAreDone) {
  const testing::Scratch scratch;
  const IdentifyOptions options = small_job(scratch);
  const Metrics whole = run(options, scratch.file("whole"), "yaml");
  EXPECT_FALSE(std::filesystem::exists(scratch.file("whole") / "elastic" / "case.h5"));

  // The second material cannot be done, since a file stands where its folder belongs.
  const std::filesystem::path directory = scratch.file("stopped");
  make_directory(directory);
  scratch.write("stopped/plasticine", "in the way");
  EXPECT_THAT(testing::error_of([&] { run(options, directory, "yaml"); }), HasSubstr("plasticine"));
  EXPECT_TRUE(std::filesystem::exists(directory / "elastic" / "case.h5"));
  EXPECT_FALSE(std::filesystem::exists(directory / "elastic" / "case.h5.tmp"));

  // Whoever does the first one again writes its latent again.
  std::filesystem::remove(directory / "elastic" / "latent.h5");
  std::filesystem::remove(directory / "plasticine");
  const Metrics resumed = run(options, directory, "yaml");
  EXPECT_FALSE(std::filesystem::exists(directory / "elastic" / "latent.h5"));
  EXPECT_TRUE(std::filesystem::exists(directory / "plasticine" / "latent.h5"));
  ASSERT_EQ(resumed.entries().size(), whole.entries().size());
  for (const auto& [name, value] : whole.entries()) {
    if (is_cost(name)) continue;
    EXPECT_EQ(*resumed.find(name), value) << name;
  }
  for (const char* material : {"elastic", "plasticine"}) {
    EXPECT_FALSE(std::filesystem::exists(directory / material / "case.h5"));
  }
}

TEST(Identify, SeesNoMoreThanItIsShown) {
  const testing::Scratch scratch;
  IdentifyOptions options = small_job(scratch);
  options.hidden.draw.materials.resize(1);
  const Metrics found = run(options, scratch.file("out"), "yaml");
  const Observation seen = read_observation(scratch.file("out") / "elastic" / "observation.h5");
  const Trajectory truth = read_trajectory(scratch.file("out") / "elastic" / "truth.h5");
  EXPECT_TRUE(seen.tracked());
  EXPECT_NEAR(double(seen.points()), 0.2 * double(truth.particles), 1);
  EXPECT_EQ(seen.frames, (truth.frames + 3) / 4);
  EXPECT_GE(seen.noise, 0.002 * 0.3);
  EXPECT_LE(seen.noise, 0.002 * 0.32 * std::sqrt(3.0));  // the largest side of a turned box
  EXPECT_NEAR(*found.find("noise_over_size.elastic"), 0.002, 1e-4);
  // All particles are judged, by where they were.
  EXPECT_EQ(read_trajectory(scratch.file("out") / "elastic" / "fitted.h5").particles,
            truth.particles);
  EXPECT_GT(*found.find("found_mse.elastic"), 0);
  EXPECT_THAT(read_text_file(scratch.file("out") / "table.md"), HasSubstr("| elastic | "));
}

TEST(Identify, TheNumbersOfAMaterialAreThoseItIsKnownBy) {
  MaterialBelief belief;
  belief.reading.material = "plasticine";
  belief.reading.mu = 1.5e5;
  belief.reading.lambda = 2e5;
  belief.reading.yield_stress = 5e3;
  EXPECT_EQ(reading_text(belief.reading), "μ 1.5e+05 Pa, τ_Y 5e+03 Pa");
  belief.low.mu = 1.4e5;
  belief.high.mu = 1.6e5;
  EXPECT_EQ(reading_text(belief), "μ 1.5e+05 [1.4e+05, 1.6e+05] Pa, τ_Y 5e+03 Pa");
  belief.reading.material = "newtonian";
  belief.reading.viscosity = 12;
  EXPECT_EQ(reading_text(belief.reading), "η 12 Pa s, κ 2e+05 Pa");
}

TEST(Identify, ResumesNothingOfAnotherConfigurationOrModel) {
  const testing::Scratch scratch;
  CaseResult done;
  done.row.material = "elastic";
  write_case_result(scratch.path(), done, "a");
  EXPECT_FALSE(read_case_result(scratch.path(), "b").has_value());
  // Of the same one, what stands beside it has to be there.
  EXPECT_THAT(testing::error_of([&] { read_case_result(scratch.path(), "a"); }),
              HasSubstr("observation.h5"));
  scratch.write("case.h5", "damaged");
  EXPECT_THAT(testing::error_of([&] { read_case_result(scratch.path(), "a"); }),
              HasSubstr("case.h5"));
}

}  // namespace
}  // namespace uniphy
