#include "uniphy/io/trajectory.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

std::vector<double> random_numbers(std::size_t count, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<double> numbers(count);
  for (double& number : numbers) number = uniform(generator);
  return numbers;
}

TrajectoryHeader header_of(std::int64_t particles) {
  TrajectoryHeader header;
  header.body.assign(particles, 0);
  header.body.back() = 1;
  header.mass = random_numbers(particles, 1);
  header.volume = random_numbers(particles, 2);
  header.scene = "grid: 20\n";
  return header;
}

Trajectory example(std::int64_t frames, std::int64_t particles) {
  Trajectory t;
  static_cast<TrajectoryHeader&>(t) = header_of(particles);
  t.frames = frames;
  t.particles = particles;
  for (std::int64_t i = 0; i < frames; ++i) {
    t.time.push_back(5e-4 * 20 * i);
    t.step.push_back(20 * i);
  }
  t.x = random_numbers(frames * particles * 3, 3);
  t.v = random_numbers(frames * particles * 3, 4);
  t.F = random_numbers(frames * particles * 9, 5);
  t.last = {random_numbers(particles * 3, 6), random_numbers(particles * 3, 7),
            random_numbers(particles * 9, 8), random_numbers(particles * 9, 9),
            random_numbers(particles, 10)};
  return t;
}

TEST(Trajectory, ReadsBackToTheSameBits) {
  const testing::Scratch scratch;
  const Trajectory written = example(11, 7);
  write_trajectory(scratch.file("t.h5"), written);
  const Trajectory read = read_trajectory(scratch.file("t.h5"));
  EXPECT_EQ(read.frames, 11);
  EXPECT_EQ(read.particles, 7);
  EXPECT_EQ(read.x, written.x);
  EXPECT_EQ(read.v, written.v);
  EXPECT_TRUE(read.C.empty());
  EXPECT_EQ(read.F, written.F);
  EXPECT_EQ(read.time, written.time);
  EXPECT_EQ(read.step, written.step);
  EXPECT_EQ(read.body, written.body);
  EXPECT_EQ(read.mass, written.mass);
  EXPECT_EQ(read.volume, written.volume);
  EXPECT_EQ(read.scene, written.scene);
  EXPECT_EQ(read.last.x, written.last.x);
  EXPECT_EQ(read.last.C, written.last.C);
  EXPECT_EQ(read.last.memory, written.last.memory);
  EXPECT_EQ(read.positions(2), read.x.data() + 42);

  const Trajectory positions = read_trajectory(scratch.file("t.h5"), true);
  EXPECT_EQ(positions.x, written.x);
  EXPECT_TRUE(positions.v.empty());
}

TEST(Trajectory, EveryDatasetCarriesUnitsAndDescription) {
  const testing::Scratch scratch;
  write_trajectory(scratch.file("t.h5"), example(2, 3));
  const hdf5::Reader reader(scratch.file("t.h5"));
  for (const char* name : {"x", "v", "F", "time", "step", "body", "mass", "volume", "final/x",
                           "final/v", "final/C", "final/F", "xdmf/vertex"}) {
    EXPECT_FALSE(reader.attribute_text(name, "units").empty()) << name;
    EXPECT_FALSE(reader.attribute_text(name, "description").empty()) << name;
  }
  EXPECT_EQ(reader.attribute_text("x", "units"), "m");
}

TEST(Trajectory, XdmfPointsAtEveryFrame) {
  const testing::Scratch scratch;
  write_trajectory(scratch.file("run.h5"), example(3, 5));
  const std::string xdmf = read_text_file(scratch.file("run.xdmf"));
  EXPECT_THAT(xdmf, HasSubstr("<DataItem Dimensions=\"5\" NumberType=\"Int\" Precision=\"4\" "
                              "Format=\"HDF\">run.h5:/xdmf/vertex<"));
  EXPECT_THAT(xdmf, HasSubstr("Dimensions=\"5 3\" NumberType=\"Float\" Precision=\"8\" "
                              "Format=\"HDF\">run.h5:/xdmf/2/x<"));
  EXPECT_THAT(xdmf, HasSubstr("Dimensions=\"5 3 3\" NumberType=\"Float\" Precision=\"8\" "
                              "Format=\"HDF\">run.h5:/xdmf/2/F<"));
  EXPECT_THAT(xdmf, HasSubstr("run.h5:/xdmf/1/v"));
  EXPECT_THAT(xdmf, ::testing::Not(HasSubstr("/C<")));
  // ParaView's HyperSlab differs from reader to reader.
  EXPECT_THAT(xdmf, ::testing::Not(HasSubstr("HyperSlab")));
  const hdf5::Reader reader(scratch.file("run.h5"));
  EXPECT_EQ(reader.members("xdmf"), (std::vector<std::string>{"0", "1", "2", "vertex"}));
  EXPECT_EQ(reader.members("xdmf/2"), (std::vector<std::string>{"F", "v", "x"}));
  EXPECT_EQ(reader.shape("xdmf/2/F"), (hdf5::Shape{5, 3, 3}));
  std::size_t grids = 0;
  for (std::size_t at = 0; (at = xdmf.find("<Time Value=", at)) != std::string::npos; ++at) ++grids;
  EXPECT_EQ(grids, 3u);
}

TEST(TrajectoryWriter, LeavesNothingBehindWithoutFinish) {
  const testing::Scratch scratch;
  {
    TrajectoryWriter writer(scratch.file("t.h5"), header_of(4));
    writer.append(0, 0, {random_numbers(12, 1), {}, {}, {}});
  }
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

TEST(Trajectory, AnIncompleteOneSaysWhy) {
  const testing::Scratch scratch;
  Trajectory written = example(3, 4);
  write_trajectory(scratch.file("t.h5"), written);
  EXPECT_EQ(read_trajectory(scratch.file("t.h5")).failure, "");
  written.failure = "particle 2 left the grid";
  write_trajectory(scratch.file("t.h5"), written);
  const Trajectory read = read_trajectory(scratch.file("t.h5"));
  EXPECT_EQ(read.failure, written.failure);
  EXPECT_EQ(read.x, written.x);
  EXPECT_TRUE(read.last.x.empty());
  EXPECT_EQ(hdf5::Reader(scratch.file("t.h5")).attribute_integer("/", "complete"), 0);
}

TEST(Trajectory, KeepsWhereItsRunStood) {
  const testing::Scratch scratch;
  Trajectory written = example(2, 4);
  const auto error = [&] {
    return testing::without_directory(
        testing::error_of([&] { read_run_state(scratch.file("t.h5")); }), scratch.path());
  };
  write_trajectory(scratch.file("t.h5"), written);
  EXPECT_FALSE(read_trajectory(scratch.file("t.h5")).end);
  EXPECT_THAT(error(), HasSubstr("t.h5: /final: expected a last state that a run can go on from"));

  written.end = RunPoint{47, 15, random_numbers(12, 9), "0123456789abcdef"};
  write_trajectory(scratch.file("t.h5"), written);
  const RunState state = read_run_state(scratch.file("t.h5"));
  EXPECT_EQ(state.particles.v, written.last.v);
  EXPECT_EQ(state.particles.memory, written.last.memory);
  EXPECT_EQ(state.point.step, 47);
  EXPECT_EQ(state.point.steps_sorted, 15);
  EXPECT_EQ(state.point.sorted_x, written.end->sorted_x);
  EXPECT_EQ(state.point.scene_hash, "0123456789abcdef");
  EXPECT_EQ(state.scene, written.scene);
  EXPECT_EQ(read_trajectory(scratch.file("t.h5")).end->step, 47);

  // One bit of the last velocities, and one of the attributes, which HDF5 gives a checksum of its
  // own: it then reads none.
  const std::string good = read_text_file(scratch.file("t.h5"));
  const auto flip = [&](const std::string& text) {
    const std::size_t at = good.find(text);
    ASSERT_NE(at, std::string::npos);
    std::string bytes = good;
    bytes[at] = static_cast<char>(bytes[at] ^ 1);
    scratch.write("t.h5", bytes);
  };
  flip({reinterpret_cast<const char*>(&written.last.v[5]), sizeof(double)});
  EXPECT_THAT(error(), HasSubstr("t.h5: /final/v: cannot be read: "));
  scratch.write("t.h5", good);
  flip(hdf5::Reader(scratch.file("t.h5")).attribute_text("/final", "checksum"));
  EXPECT_THAT(error(), HasSubstr("t.h5: /final: expected "));

  written.failure = "particle 2 left the grid";
  write_trajectory(scratch.file("t.h5"), written);
  EXPECT_EQ(error(),
            "t.h5: expected a complete trajectory, found one whose run failed: particle 2 left the "
            "grid");
}

TEST(TrajectoryWriter, RefusesWhatDoesNotFit) {
  const testing::Scratch scratch;
  const auto message = [&](auto function) {
    return testing::without_directory(testing::error_of(function), scratch.path());
  };
  TrajectoryWriter writer(scratch.file("t.h5"), header_of(4), {true, false, false});
  const ParticleState state{random_numbers(12, 1), random_numbers(12, 2), {}, {}};
  writer.append(1, 10, state);
  EXPECT_EQ(message([&] { writer.append(1, 20, state); }),
            "t.h5: /time: expected increasing times and steps, found 1 s (step 20) after 1 s (step "
            "10)");
  EXPECT_EQ(message([&] {
              writer.append(2, 20, {random_numbers(12, 1), {}, {}, {}});
            }),
            "t.h5: /v: expected 12 numbers, found 0");
  TrajectoryHeader header = header_of(4);
  header.mass.pop_back();
  EXPECT_EQ(message([&] { TrajectoryWriter(scratch.file("u.h5"), header); }),
            "u.h5: /mass: expected 4 numbers, found 3");
}

TEST(Trajectory, MalformedFilesAreRefused) {
  struct Case {
    const char* message;
    std::function<void(hdf5::Writer&)> fill;
  };
  const hdf5::Info info{"m", ""};
  const auto start = [](hdf5::Writer& w) {
    w.attribute("/", "format", "uniphy-trajectory");
    w.attribute("/", "version", 1);
    w.attribute("/", "scene", "");
  };
  const Case cases[] = {
      {"t.h5: /x: expected a dataset, found nothing of that name", start},
      {"t.h5: /x: expected the shape [-1, -1, 3], found [2, 3]",
       [&](hdf5::Writer& w) {
         start(w);
         w.write("x", std::vector<double>(6), {2, 3}, info);
       }},
      {"t.h5: /x: expected at least one frame and one particle, found the shape [0, 4, 3]",
       [&](hdf5::Writer& w) {
         start(w);
         w.write("x", std::vector<double>(), {0, 4, 3}, info);
       }},
      {"t.h5: /time: expected the shape [2], found [3]",
       [&](hdf5::Writer& w) {
         start(w);
         w.write("x", std::vector<double>(6), {2, 1, 3}, info);
         w.write("time", std::vector<double>{0, 1, 2}, {3}, info);
       }},
      {"t.h5: /time: expected increasing times, found 0 s after 0 s",
       [&](hdf5::Writer& w) {
         start(w);
         w.write("x", std::vector<double>(6), {2, 1, 3}, info);
         w.write("time", std::vector<double>{0, 0}, {2}, info);
         w.write("step", std::vector<std::int64_t>{0, 1}, {2}, info);
       }},
      {"t.h5: attribute format: expected \"uniphy-trajectory\", found \"uniphy-model\"",
       [](hdf5::Writer& w) { w.attribute("/", "format", "uniphy-model"); }},
  };
  for (const Case& c : cases) {
    const testing::Scratch scratch;
    hdf5::Writer writer(scratch.file("t.h5"));
    c.fill(writer);
    writer.commit();
    EXPECT_EQ(
        testing::without_directory(
            testing::error_of([&] { read_trajectory(scratch.file("t.h5")); }), scratch.path()),
        c.message);
  }
}

}  // namespace
}  // namespace uniphy
