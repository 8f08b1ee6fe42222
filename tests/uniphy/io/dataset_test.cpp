#include "uniphy/io/dataset.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using ::testing::ElementsAre;

LawSamples samples_of(int count, double start) {
  LawSamples samples;
  for (int i = 0; i < 9 * count; ++i) {
    samples.F.push_back(start + i);
    samples.F_proj.push_back(start + i + 0.25);
    samples.C.push_back(start + i + 0.5);
    samples.tau.push_back(1e5 * (start + i));
  }
  return samples;
}

TrajectoryRecord record_of(const std::string& material) {
  TrajectoryRecord record;
  record.material = material;
  record.parameters[0] = 1e4;
  record.parameters[1] = 2e4;
  record.dt = 1.0 / 4800;
  record.density = 1000;
  record.seed = 77;
  record.shape = "torus";
  return record;
}

TEST(Dataset, ReadsBackWhatWasAppendedTrajectoryByTrajectory) {
  for (const int gzip : {0, 4}) {
    const testing::Scratch scratch;
    DatasetWriter writer(scratch.file("d.h5"), "seed: 1\n", gzip);
    writer.append(record_of("elastic"), samples_of(5, 0));
    writer.append(record_of("newtonian"), samples_of(1, 3));
    writer.append(record_of("sand"), samples_of(2000, 1000));
    EXPECT_EQ(writer.samples(), 2006);
    writer.finish();

    const Dataset dataset = read_dataset(scratch.file("d.h5"));
    EXPECT_EQ(dataset.config, "seed: 1\n");
    ASSERT_EQ(dataset.trajectories.size(), 3u);
    EXPECT_THAT(dataset.first, ElementsAre(0, 5, 6, 2006));
    EXPECT_EQ(dataset.samples.size(), 2006);
    EXPECT_EQ(dataset.trajectories[2].material, "sand");
    EXPECT_EQ(dataset.trajectories[2].parameters[1], 2e4);
    EXPECT_TRUE(std::isnan(dataset.trajectories[2].parameters[4]));
    EXPECT_EQ(dataset.trajectories[0].dt, 1.0 / 4800);
    EXPECT_EQ(dataset.trajectories[0].seed, 77);
    EXPECT_EQ(dataset.trajectories[1].shape, "torus");
    EXPECT_EQ(dataset.trajectory[4], 0);
    EXPECT_EQ(dataset.trajectory[5], 1);
    EXPECT_EQ(dataset.trajectory[6], 2);
    const LawSamples last = samples_of(2000, 1000);
    EXPECT_TRUE(std::equal(last.tau.begin(), last.tau.end(), dataset.samples.tau.begin() + 54));
    EXPECT_TRUE(std::equal(last.C.begin(), last.C.end(), dataset.samples.C.begin() + 54));
    EXPECT_TRUE(
        std::equal(last.F_proj.begin(), last.F_proj.end(), dataset.samples.F_proj.begin() + 54));
    EXPECT_TRUE(std::equal(last.F.begin(), last.F.end(), dataset.samples.F.begin() + 54));
  }
}

TEST(Dataset, TimeStepsAreTheShortestAndTheLongest) {
  Dataset dataset;
  EXPECT_EQ(time_steps(dataset), (std::array<double, 2>{0, 0}));
  dataset.trajectories.assign(3, record_of("sand"));
  dataset.trajectories[1].dt = 1e-4;
  EXPECT_EQ(time_steps(dataset), (std::array<double, 2>{1e-4, 1.0 / 4800}));
}

TEST(DatasetWriter, RefusesUnevenSamplesAndKeepsNothingWithoutFinish) {
  const testing::Scratch scratch;
  {
    DatasetWriter writer(scratch.file("d.h5"));
    LawSamples samples = samples_of(3, 0);
    samples.tau.pop_back();
    EXPECT_EQ(
        testing::without_directory(
            testing::error_of([&] { writer.append(record_of("sand"), samples); }), scratch.path()),
        "d.h5: /samples/tau: expected 27 numbers, found 26");
  }
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

TEST(Dataset, MalformedFilesAreRefused) {
  const auto message = [](const std::vector<std::int32_t>& rows, double tau, double dt) {
    const testing::Scratch scratch;
    hdf5::Writer w(scratch.file("d.h5"));
    const auto count = static_cast<std::int64_t>(rows.size());
    const hdf5::Info info{"1", ""};
    w.attribute("/", "format", "uniphy-dataset");
    w.attribute("/", "version", 1);
    w.attribute("/", "config", "");
    for (const char* name : {"F", "F_proj", "C", "tau"}) {
      w.write(std::string("samples/") + name, std::vector<double>(9 * count, tau), {count, 3, 3},
              info);
    }
    w.write("samples/trajectory", rows, {count}, info);
    w.write_strings("trajectories/material", {"sand", "elastic"}, info);
    w.write("trajectories/parameters", std::vector<double>(10), {2, 5}, info);
    w.write("trajectories/dt", std::vector<double>(2, dt), {2}, info);
    w.write("trajectories/density", std::vector<double>(2, 1000), {2}, info);
    w.write("trajectories/seed", std::vector<std::int64_t>(2), {2}, info);
    w.write_strings("trajectories/shape", {"box", "box"}, info);
    w.commit();
    return testing::without_directory(
        testing::error_of([&] { read_dataset(scratch.file("d.h5")); }), scratch.path());
  };
  EXPECT_EQ(message({0, 1, 0}, 1, 1e-3),
            "d.h5: /samples/trajectory: expected rows from 0 to 1 in order, found 0 after 1");
  EXPECT_EQ(message({0, 2}, 1, 1e-3),
            "d.h5: /samples/trajectory: expected rows from 0 to 1 in order, found 2 after 0");
  EXPECT_EQ(message({-1}, 1, 1e-3),
            "d.h5: /samples/trajectory: expected rows from 0 to 1 in order, found -1 after 0");
  EXPECT_EQ(message({0}, std::nan(""), 1e-3),
            "d.h5: /samples/F: expected finite numbers, found nan at position 0");
  EXPECT_EQ(
      message({0, 0, 1}, 1e300, 1e-3),
      "d.h5: /samples/F: expected numbers of at most 1e+06 either way, found 1e+300 at position 0");
  EXPECT_EQ(message({0, 0, 0}, 1, 1e-3),
            "d.h5: /samples/trajectory: expected samples of all 2 trajectories, found none of "
            "trajectory 1");
  EXPECT_EQ(message({0}, 1, 0), "d.h5: /trajectories/dt: expected time steps > 0 s, found 0");
}

TEST(Dataset, WithoutTrajectoriesIsRefused) {
  const testing::Scratch scratch;
  DatasetWriter writer(scratch.file("d.h5"));
  writer.finish();
  EXPECT_EQ(testing::without_directory(
                testing::error_of([&] { read_dataset(scratch.file("d.h5")); }), scratch.path()),
            "d.h5: /trajectories/material: expected at least one trajectory, found none");
}

}  // namespace
}  // namespace uniphy
