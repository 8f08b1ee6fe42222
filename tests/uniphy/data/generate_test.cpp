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
        " step: 0.02, strain: 0.3, beyond: 2, affine: [0.5, 7]}},"
        " random_laws: {fluids: 4, plastics: 2}}"}) {
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

constexpr const char* kWithRandomLaws =
    "{trajectories: 2, simulation: {steps: 200, particles: 100}, samples: {per_trajectory: 80},"
    " random_laws: {solids: 3, fluids: 2, plastics: 4}}";

TEST(RandomLaws, FollowTheFamiliesWithTheSameBitsOnTwoThreads) {
  testing::Scratch scratch;
  const GenerateOptions options = options_of(kWithRandomLaws);
  Metrics metrics, unused;
  const std::string one = generate(options, scratch.file("one.h5"), 1, metrics);
  EXPECT_TRUE(one == generate(options, scratch.file("two.h5"), 2, unused));
  EXPECT_EQ(metrics.find("trajectories"), 19);
  EXPECT_EQ(metrics.find("drawn.random_plastic"), 320);
  EXPECT_GT(*metrics.find("share.random_plastic.yield"), 0.2);
  EXPECT_GT(*metrics.find("strain_high.random_fluid"), 0);

  Dataset data = read_dataset(scratch.file("one.h5"));
  data.config = kWithRandomLaws;
  std::vector<std::string> names;
  for (std::size_t i = 10; i < data.trajectories.size(); ++i) {
    const TrajectoryRecord& record = data.trajectories[i];
    names.push_back(record.material);
    for (const double parameter : record.parameters) EXPECT_TRUE(std::isnan(parameter));
    EXPECT_GT(record.dt, 0);
    EXPECT_EQ(data.first[i + 1] - data.first[i], 80);
  }
  EXPECT_EQ(names,
            (std::vector<std::string>{"random_solid", "random_solid", "random_solid",
                                      "random_fluid", "random_fluid", "random_plastic",
                                      "random_plastic", "random_plastic", "random_plastic"}));
  EXPECT_THAT(testing::error_of([&] { setup_of(data, 10); }), HasSubstr("has no scene"));
  EXPECT_EQ(setup_of(data, 3).record.material, data.trajectories[3].material);
}

TEST(RandomLaws, LeaveTheFamiliesAndEachOtherAsTheyWere) {
  testing::Scratch scratch;
  Metrics metrics;
  GenerateOptions options = options_of(kWithRandomLaws);
  generate(options, scratch.file("with.h5"), 2, metrics);
  options.random_laws = {0, 0, 0};
  generate(options, scratch.file("without.h5"), 2, metrics);
  options.random_laws = {5, 0, 4};
  generate(options, scratch.file("more.h5"), 2, metrics);
  const Dataset with = read_dataset(scratch.file("with.h5")),
                without = read_dataset(scratch.file("without.h5")),
                more = read_dataset(scratch.file("more.h5"));
  const auto part = [](const Dataset& data, std::size_t first, std::size_t last) {
    return std::vector<double>(data.samples.tau.begin() + 9 * data.first[first],
                               data.samples.tau.begin() + 9 * data.first[last]);
  };
  EXPECT_EQ(part(with, 0, 10), without.samples.tau);
  EXPECT_EQ(part(with, 0, 13), part(more, 0, 13));
  EXPECT_EQ(part(with, 15, 19), part(more, 15, 19));
}

TEST(RandomLaws, GoOnWhereTheyStopped) {
  testing::Scratch scratch;
  const GenerateOptions options = options_of(kWithRandomLaws);
  Metrics metrics;
  const std::string whole = generate(options, scratch.file("d.h5"), 1, metrics);
  std::filesystem::remove(scratch.file("d.h5"));
  // What a run leaves that was interrupted among its random laws.
  const auto parts = parts_directory(scratch.file("d.h5"), kSmall);
  std::filesystem::create_directories(parts);
  const Dataset data = [&] {
    scratch.write("whole.h5", whole);
    return read_dataset(scratch.file("whole.h5"));
  }();
  for (const std::int64_t i : {0, 1, 2, 11}) {
    TrajectoryPart part;
    const auto copy = [&](const std::vector<double>& from) {
      return std::vector<double>(from.begin() + 9 * data.first[i],
                                 from.begin() + 9 * data.first[i + 1]);
    };
    part.attempt = data.trajectories[i].attempt;
    part.samples = {copy(data.samples.F),
                    copy(data.samples.F_proj),
                    copy(data.samples.C),
                    copy(data.samples.tau),
                    {data.samples.source.begin() + data.first[i],
                     data.samples.source.begin() + data.first[i + 1]}};
    if (i == 11) part.failures = {"mark"};  // shows that it is not made again
    write_part(part_path(parts, i), part);
  }
  Metrics resumed;
  EXPECT_TRUE(generate(options, scratch.file("d.h5"), 2, resumed) == whole);
  EXPECT_EQ(resumed.find("failed.random_solid"), 1);
  EXPECT_FALSE(std::filesystem::exists(parts));
}

TEST(RandomLaws, WithoutStatesAreRefused) {
  EXPECT_EQ(testing::error_of(
                [] { options_of("{materials: [elastic, sand], random_laws: {fluids: 2}}"); }),
            "config:1: random_laws.fluids: expected 0 where `materials` has none of which "
            "states are taken, found 2");
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
