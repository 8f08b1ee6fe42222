#include "uniphy/data/generate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/on_threads.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/data/dataset_setup.hpp"
#include "uniphy/data/law_branches.hpp"
#include "uniphy/data/part_file.hpp"
#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

GenerateOptions options_of(const std::string& yaml) {
  Config config = Config::parse(yaml);
  Section root = config.root();
  return read_generate_options(root);
}

constexpr const char* kSmall =
    "trajectories: 2\n"
    "simulation: {steps: 200, particles: 100}\n"
    "samples: {per_trajectory: 80}\n";

std::string generate(const GenerateOptions& options, const std::filesystem::path& file, int threads,
                     Metrics& metrics) {
  testing::on_threads(threads, [&] { generate_dataset(options, kSmall, file, metrics); });
  return read_text_file(file);
}

/// Free fall in a gravity that drives what falls far through the floor.
GenerateOptions deep_fall() {
  GenerateOptions options = options_of(
      "{trajectories: 6, materials: [elastic], simulation: {steps: 100, particles: 60},"
      " samples: {per_trajectory: 40}, motion: {kinds: [falling], speed: [5, 5], gap: [0, 0.3]}}");
  options.grid.gravity[1] = -1e6;
  return options;
}

TEST(Generate, SameBitsOnOneThreadAndTwo) {
  testing::Scratch scratch;
  const GenerateOptions options = options_of(kSmall);
  Metrics metrics;
  const std::string one = generate(options, scratch.file("one.h5"), 1, metrics);
  const std::string two = generate(options, scratch.file("two.h5"), 2, metrics);
  EXPECT_GT(one.size(), 100000u);
  EXPECT_TRUE(one == two);
  EXPECT_EQ(metrics.find("trajectories"), 10);
  EXPECT_EQ(metrics.find("samples"), 800);
  // Nothing is left beside the two files.
  for (const auto& entry : std::filesystem::directory_iterator(scratch.path())) {
    EXPECT_EQ(entry.path().extension(), ".h5") << entry.path();
  }
}

TEST(Generate, TheFileHoldsWhatTheLawsAnswer) {
  testing::Scratch scratch;
  const GenerateOptions options = options_of(kSmall);
  Metrics metrics;
  generate(options, scratch.file("d.h5"), 2, metrics);
  const Dataset data = read_dataset(scratch.file("d.h5"));
  ASSERT_EQ(data.trajectories.size(), 10u);
  ASSERT_EQ(data.samples.source.size(), 800u);
  for (std::int64_t i = 0; i < options.total(); ++i) {
    const TrajectorySetup setup = draw_setup(options, i, 0);
    EXPECT_EQ(data.trajectories[static_cast<std::size_t>(i)].material, setup.record.material);
    const auto law = kernels::make_law<double>(setup.law());
    const std::int64_t first = data.first[static_cast<std::size_t>(i)];
    ASSERT_EQ(data.first[static_cast<std::size_t>(i) + 1] - first, 80);
    int drawn = 0;
    for (std::int64_t s = first; s < first + 80; ++s) {
      drawn += data.samples.source[static_cast<std::size_t>(s)];
      double F_proj[9], tau[9];
      law->evaluate(1, setup.record.dt, {&data.samples.F[9 * s], 9, 1},
                    {&data.samples.C[9 * s], 9, 1}, {F_proj, 9, 1}, {tau, 9, 1});
      double norm = 1e-9 * (setup.law().mu + setup.law().lambda);
      for (int k = 0; k < 9; ++k) norm = std::max(norm, std::abs(tau[k]));
      for (int k = 0; k < 9; ++k) {
        EXPECT_NEAR(data.samples.F_proj[9 * s + k], F_proj[k], 1e-11);
        EXPECT_NEAR(data.samples.tau[9 * s + k], tau[k], 1e-9 * norm) << setup.record.material;
      }
    }
    EXPECT_EQ(drawn, 20);
  }
}

TEST(Generate, GoesOnWhereItStopped) {
  testing::Scratch scratch;
  const GenerateOptions options = options_of(kSmall);
  Metrics metrics;
  const std::string whole = generate(options, scratch.file("whole.h5"), 1, metrics);

  // A run that ends at the fourth trajectory leaves three parts.
  GenerateOptions broken = options;
  broken.attempts = 1;
  broken.materials[1].interval[0] = {-1, -1};  // no viscosity
  EXPECT_THAT(testing::error_of([&] { generate(broken, scratch.file("resumed.h5"), 1, metrics); }),
              HasSubstr("mu"));
  EXPECT_FALSE(std::filesystem::exists(scratch.file("resumed.h5")));
  std::filesystem::path parts;
  for (const auto& entry : std::filesystem::directory_iterator(scratch.path())) {
    if (entry.is_directory()) parts = entry.path();
  }
  ASSERT_TRUE(std::filesystem::exists(part_path(parts, 0)));
  ASSERT_TRUE(std::filesystem::exists(part_path(parts, 1)));
  EXPECT_FALSE(std::filesystem::exists(part_path(parts, 2)));

  // A mark in the first part shows that it is not made again.
  TrajectoryPart part = *read_part(part_path(parts, 0));
  part.failures.push_back("mark");
  write_part(part_path(parts, 0), part);
  Metrics resumed;
  EXPECT_TRUE(generate(options, scratch.file("resumed.h5"), 2, resumed) == whole);
  EXPECT_EQ(resumed.find("failed.elastic"), 1);
  EXPECT_FALSE(std::filesystem::exists(parts));
}

TEST(Generate, RunsThatFailAreReplacedAndCounted) {
  testing::Scratch scratch;
  GenerateOptions options = deep_fall();
  options.attempts = 100;
  Metrics metrics;
  ::testing::internal::CaptureStderr();
  generate(options, scratch.file("d.h5"), 2, metrics);
  const std::string report = ::testing::internal::GetCapturedStderr();
  const Dataset data = read_dataset(scratch.file("d.h5"));
  EXPECT_EQ(data.trajectories.size(), 6u);
  EXPECT_GT(*metrics.find("failed.elastic"), 0);
  EXPECT_THAT(report, HasSubstr("left out: trajectory"));
  EXPECT_THAT(report, HasSubstr("elastic, mu "));
  // The parameters are those of the attempt that ended well.
  std::int64_t attempts = 0;
  for (std::int64_t i = 0; i < 6; ++i) {
    const TrajectoryRecord& record = data.trajectories[static_cast<std::size_t>(i)];
    EXPECT_EQ(draw_setup(options, i, record.attempt).law().mu, record.parameters[0]);
    attempts += record.attempt;
  }
  EXPECT_EQ(attempts, *metrics.find("failed.elastic"));
}

TEST(Generate, TheFileLeadsBackToItsScenes) {
  testing::Scratch scratch;
  const GenerateOptions options = options_of(kSmall);
  Metrics metrics;
  generate(options, scratch.file("d.h5"), 2, metrics);
  Dataset data = read_dataset(scratch.file("d.h5"));
  for (std::int64_t i = 0; i < options.total(); ++i) {
    const TrajectorySetup setup = setup_of(data, i);
    EXPECT_EQ(place_scene(setup.scene).x, place_scene(draw_setup(options, i, 0).scene).x);
  }
  EXPECT_THAT(testing::error_of([&] { setup_of(data, 10); }), HasSubstr("trajectory 10"));
  data.trajectories[3].parameters[0] *= 1.001;
  EXPECT_THAT(testing::error_of([&] { setup_of(data, 3); }), HasSubstr("other parameters"));
  data.config = "scene: {}\n";
  EXPECT_THAT(testing::error_of([&] { setup_of(data, 0); }), HasSubstr("config of the data set"));
}

TEST(GenerateConfig, ReadsBackToTheSameOptions) {
  for (const char* yaml :
       {kSmall, "split: heldout_all\nseed: 9\n",
        "{materials: [sand, newtonian], split: heldout_materials, attempts: 7,"
        " ranges: {sand: {theta: [0.1, 0.2]}, newtonian: {mu: [60, 70]}},"
        " simulation: {grid: 24, bound: 4, wall: noslip, gravity: [0, -1, 0.5], dt: auto,"
        " density: 800}, body: {shapes: [box], heldout_shapes: [gear, pawn], size: [0.1, 0.2]},"
        " motion: {kinds: [left], speed: [1, 2], impact_over_yield: [1, 2], gap: [0, 0.1],"
        " angular_speed: [1, 2]}, samples: {every: 3, uniform_share: 0.5, drawn: {share: 0.1,"
        " step: 0.02, strain: 0.3, beyond: 2, affine: [0.5, 7]}}}"}) {
    const std::string once = generate_config(options_of(yaml));
    EXPECT_EQ(generate_config(options_of(once)), once);
    // Ranges of materials that are not drawn are all that the text may lose.
    if (std::string(yaml).find("materials: [") != std::string::npos) continue;
    const Config config = Config::parse(yaml);
    Section root = config.root();
    read_generate_options(root);
    EXPECT_EQ(once, config.resolved());
  }
  const GenerateOptions o = options_of(
      generate_config(options_of("{materials: [sand], ranges: {sand: {theta: [0.1, 0.2]}},"
                                 " simulation: {dt: auto, gravity: [0, -1, 0.5]}}")));
  EXPECT_EQ(o.materials.size(), 1u);
  EXPECT_EQ(o.materials[0].interval[3], (std::array<double, 2>{0.1, 0.2}));
  EXPECT_FALSE(o.dt);
  EXPECT_EQ(o.grid.gravity[2], 0.5);
}

TEST(Generate, ADrawnSetIsKeptUntilAnotherIsAsked) {
  testing::Scratch scratch;
  GenerateOptions options = options_of(kSmall);
  const auto file = scratch.file("d.h5");
  Metrics drawn, kept;
  EXPECT_EQ(drawn_dataset(options, file, &drawn).trajectories.size(), 10u);
  EXPECT_EQ(drawn.find("trajectories"), 10);
  const std::string bytes = read_text_file(file);
  drawn_dataset(options, file, &kept);
  EXPECT_TRUE(kept.entries().empty());
  EXPECT_TRUE(read_text_file(file) == bytes);
  options.seed = 5;
  EXPECT_EQ(drawn_dataset(options, file).trajectories[0].seed, 5);
  scratch.write("d.h5", "something else");
  EXPECT_THAT(testing::error_of([&] { drawn_dataset(options, file); }), HasSubstr("d.h5"));
}

TEST(Generate, GivesUpAfterTheAttempts) {
  testing::Scratch scratch;
  GenerateOptions options = deep_fall();
  options.grid.gravity[1] = -1e8;
  options.attempts = 3;
  Metrics metrics;
  const std::string message =
      testing::error_of([&] { generate(options, scratch.file("d.h5"), 2, metrics); });
  EXPECT_THAT(message, HasSubstr("all 3 attempts failed, the last one: elastic, mu "));
  EXPECT_FALSE(std::filesystem::exists(scratch.file("d.h5")));
}

TEST(Generate, APartThatIsNoneIsNamed) {
  testing::Scratch scratch;
  const auto file = scratch.write("000000.h5", "not HDF5");
  EXPECT_THAT(testing::error_of([&] { read_part(file); }), HasSubstr("000000.h5"));
  EXPECT_FALSE(read_part(scratch.file("000001.h5")).has_value());
}

// The point of it all: every branch of every law is there, in what the simulations gave and in all.
TEST(Generate, EveryBranchIsWellRepresented) {
  testing::Scratch scratch;
  const GenerateOptions options = options_of(
      "{trajectories: 8, simulation: {steps: 1200, particles: 250},"
      " samples: {per_trajectory: 300}}");
  Metrics metrics;
  generate(options, scratch.file("d.h5"), 2, metrics);
  for (const MaterialRanges& material : options.materials) {
    const std::string name = material.name();
    for (const std::string& branch : branch_names(material.id)) {
      // Many of the drawn non_newtonian materials cannot yield at any strain there is, and far
      // outside the surface is where viscosity holds the stress.
      const bool rare = name == "non_newtonian" || (name == "plasticine" && branch == "yield");
      EXPECT_GT(*metrics.find("share." + name + "." + branch), rare ? 0.02 : 0.06)
          << name << " " << branch;
    }
    EXPECT_LT(*metrics.find("strain_low." + name), 1e-4) << name;
    EXPECT_GT(*metrics.find("strain_high." + name), 0.05) << name;
    EXPECT_GT(*metrics.find("large_affine." + name), 0.1) << name;
    EXPECT_EQ(*metrics.find("failed." + name), 0) << name;
  }
  EXPECT_EQ(*metrics.find("yielding.plasticine"), 1);
  EXPECT_EQ(*metrics.find("yielding.sand"), 1);
  EXPECT_GE(*metrics.find("yielding.non_newtonian"), 0.25);
}

}  // namespace
}  // namespace uniphy
