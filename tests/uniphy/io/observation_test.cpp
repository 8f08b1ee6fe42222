#include "uniphy/io/observation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "tests/uniphy/io/observation_examples.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/hdf5.hpp"

namespace uniphy {
namespace {

using testing::cloud_example;
using testing::comparable;
using testing::example;

TEST(Observation, ReadsBackToTheSameBits) {
  const testing::Scratch scratch;
  const Observation written = example();
  write_observation(scratch.file("o.h5"), written);
  const Observation read = read_observation(scratch.file("o.h5"));
  EXPECT_EQ(read.x, written.x);
  EXPECT_EQ(read.time, written.time);
  EXPECT_EQ(read.volume, written.volume);
  EXPECT_EQ(read.frames, 3);
  EXPECT_EQ(read.particles, 2);
  EXPECT_EQ(read.grid, 32);
  EXPECT_EQ(read.dt, 2.5e-4);
  EXPECT_EQ(read.gravity, written.gravity);
  EXPECT_EQ(read.walls, "noslip");
  EXPECT_EQ(read.bound, 4);
  EXPECT_EQ(read.density, 1500);
  EXPECT_EQ(read.positions(1)[0], 0.06);
}

TEST(Observation, TrackedPointsAndTheirBodyReadBack) {
  const testing::Scratch scratch;
  Observation written = example();
  written.body = {0.1, 0.1, 0.1, 0.2, 0.1, 0.1, 0.1, 0.3, 0.1};
  written.particles = 3;
  written.volume = {1e-6, 2e-6, 3e-6};
  written.tracers.assign(written.x.begin(), written.x.begin() + 6);
  written.noise = 1e-3;
  written.start_degree = 2;
  for (int k = 0; k < 3; ++k) written.x[9 + k] = std::nan("");  // point 1 in frame 1
  write_observation(scratch.file("o.h5"), written);
  const Observation read = read_observation(scratch.file("o.h5"));
  EXPECT_TRUE(read.tracked());
  EXPECT_EQ(read.points(), 2);
  EXPECT_EQ(read.particles, 3);
  EXPECT_EQ(read.body, written.body);
  EXPECT_EQ(read.start(), written.body);
  EXPECT_EQ(read.tracers, written.tracers);
  EXPECT_EQ(read.noise, 1e-3);
  EXPECT_EQ(read.start_degree, 2);
  EXPECT_FALSE(read.is_seen(1, 1));
  EXPECT_TRUE(read.is_seen(1, 0));
  EXPECT_EQ(read.positions(2)[0], 0.12);
}

TEST(Observation, CloudsReadBack) {
  const testing::Scratch scratch;
  const Observation written = cloud_example();
  write_observation(scratch.file("o.h5"), written);
  const hdf5::Reader reader(scratch.file("o.h5"));
  EXPECT_EQ(reader.attribute_integer("/", "version"), 2);
  EXPECT_EQ(reader.attribute_text("x", "correspondence"), "none");
  const Observation read = read_observation(scratch.file("o.h5"));
  EXPECT_EQ(read.cloud, 2);
  EXPECT_EQ(read.points(), 2);
  EXPECT_FALSE(read.tracked());
  EXPECT_EQ(read.particles, 3);
  EXPECT_EQ(read.start(), written.body);
  EXPECT_EQ(comparable(read.x), comparable(written.x));
  EXPECT_FALSE(read.is_seen(1, 0));
  EXPECT_FALSE(read.is_seen(2, 0));
  EXPECT_TRUE(read.is_seen(2, 1));
}

TEST(Observation, CloudsMayStandBesideASurfaceAndBeginLate) {
  const testing::Scratch scratch;
  Observation written = cloud_example();
  written.body.clear();
  written.volume.clear();
  written.particles = 0;
  written.vertices = {0.1, 0.1, 0.1, 0.3, 0.1, 0.1, 0.1, 0.3, 0.1, 0.1, 0.1, 0.3};
  written.triangles = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
  std::copy_n(example().x.begin() + 6, 6, written.x.begin() + 6);
  std::fill_n(written.x.begin(), 6, std::nan(""));
  write_observation(scratch.file("o.h5"), written);
  const Observation read = read_observation(scratch.file("o.h5"));
  EXPECT_EQ(read.cloud, 2);
  EXPECT_EQ(read.vertices, written.vertices);
  EXPECT_FALSE(read.is_seen(0, 0));
  EXPECT_TRUE(read.is_seen(1, 0));
}

TEST(Observation, ImpossibleCloudsAreRefused) {
  struct Case {
    const char* message;
    std::function<void(Observation&)> spoil;
  };
  const Case cases[] = {
      {"o.h5: /x: expected at least two frames with a point (attribute correspondence: \"none\"), "
       "found 1",
       [](Observation& o) { std::fill(o.x.begin() + 6, o.x.end(), std::nan("")); }},
      {"o.h5: /x: expected three coordinates, or NaN in all of them, found both of point 1 in "
       "frame 0",
       [](Observation& o) { o.x[4] = std::nan(""); }},
      {"o.h5: /x: expected positions inside the unit cube, found 2 m of point 1 in frame 2",
       [](Observation& o) { o.x[16] = 2; }},
      {"o.h5: /body: expected the particles or the surface of the body beside clouds, found "
       "neither",
       [](Observation& o) { o.body.clear(); }},
      {"o.h5: /x: expected tracked points or clouds, found both",
       [](Observation& o) { o.tracers.assign(6, 0.1); }},
      {"o.h5: /body/volume: expected volumes > 0, found 0",
       [](Observation& o) { o.volume[1] = 0; }},
  };
  for (const Case& c : cases) {
    const testing::Scratch scratch;
    Observation observation = cloud_example();
    c.spoil(observation);
    EXPECT_EQ(testing::without_directory(
                  testing::error_of([&] { write_observation(scratch.file("o.h5"), observation); }),
                  scratch.path()),
              c.message);
  }
}

TEST(Observation, HoldsNothingAboutTheMaterial) {
  const testing::Scratch scratch;
  write_observation(scratch.file("o.h5"), example());
  const hdf5::Reader reader(scratch.file("o.h5"));
  EXPECT_THAT(reader.members("/"), ::testing::ElementsAre("scene", "time", "volume", "x"));
  EXPECT_TRUE(reader.members("scene").empty());
}

// What a writer refuses and what a reader refuses is one list.
TEST(Observation, ImpossibleValuesAreRefused) {
  struct Case {
    const char* message;
    std::function<void(Observation&)> spoil;
  };
  const Case cases[] = {
      {"o.h5: attribute grid of /scene: expected 8 to 1024 nodes, found 4",
       [](Observation& o) { o.grid = 4; }},
      {"o.h5: attribute dt of /scene: expected a time step in [1e-09, 1) s, found 0",
       [](Observation& o) { o.dt = 0; }},
      {"o.h5: attribute walls of /scene: expected \"freeslip\" or \"noslip\", found \"sticky\"",
       [](Observation& o) { o.walls = "sticky"; }},
      {"o.h5: attribute bound of /scene: expected 1 to 15 nodes, found 16",
       [](Observation& o) { o.bound = 16; }},
      {"o.h5: attribute density of /scene: expected a density of 0.001 to 1000000 kg/m^3, found -1",
       [](Observation& o) { o.density = -1; }},
      {"o.h5: attribute gravity of /scene: expected at most 10000000 m/s^2 either way, found nan",
       [](Observation& o) { o.gravity[2] = std::nan(""); }},
      // Twice this is not an int.
      {"o.h5: attribute bound of /scene: expected 1 to 15 nodes, found 1073741824",
       [](Observation& o) { o.bound = 1 << 30; }},
      {"o.h5: attribute dt of /scene: expected a time step in [1e-09, 1) s, found 1e-300",
       [](Observation& o) { o.dt = 1e-300; }},
      {"o.h5: attribute density of /scene: expected a density of 0.001 to 1000000 kg/m^3, found "
       "1e+300",
       [](Observation& o) { o.density = 1e300; }},
      {"o.h5: attribute gravity of /scene: expected at most 10000000 m/s^2 either way, found "
       "1e+300",
       [](Observation& o) { o.gravity[1] = 1e300; }},
      {"o.h5: /x: expected a body, found all 2 particles at one place in the first frame",
       [](Observation& o) { o.x.assign(o.x.size(), 0); }},
      {"o.h5: /time: expected increasing times, found 0.1 s after 0.1 s",
       [](Observation& o) { o.time[2] = 0.1; }},
      {"o.h5: /x: expected positions inside the unit cube, found -0.1 m of point 1 in frame 2",
       [](Observation& o) { o.x[16] = -0.1; }},
      {"o.h5: /volume: expected a body that fits the unit cube, found 2.000002 m^3 in all",
       [](Observation& o) { o.volume[0] = 2; }},
      {"o.h5: /volume: expected volumes > 0, found 0", [](Observation& o) { o.volume[0] = 0; }},
      {"o.h5: /x: expected 18 numbers for the shape [3, 2, 3], found 17",
       [](Observation& o) { o.x.pop_back(); }},
      {"o.h5: attribute start_degree of /x: expected 0 to 3, found 4",
       [](Observation& o) { o.start_degree = 4; }},
      {"o.h5: /x: expected at least two frames of one point, found 1 of 2",
       [](Observation& o) { o.frames = 1; }},
  };
  for (const Case& c : cases) {
    const testing::Scratch scratch;
    Observation observation = example();
    c.spoil(observation);
    EXPECT_EQ(testing::without_directory(
                  testing::error_of([&] { write_observation(scratch.file("o.h5"), observation); }),
                  scratch.path()),
              c.message);
    EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
  }
}

TEST(Observation, MalformedFilesAreRefused) {
  struct Case {
    const char* message;
    std::function<void(hdf5::Writer&)> spoil;
  };
  const hdf5::Info info{"m", ""};
  const Case cases[] = {
      {"o.h5: attribute grid of /scene: expected 8 to 1024 nodes, found 2147483647",
       [](hdf5::Writer& w) { w.attribute("scene", "grid", std::int64_t{1} << 40); }},
      {"o.h5: attribute dt of /scene: expected numbers, found text",
       [](hdf5::Writer& w) { w.attribute("scene", "dt", "1"); }},
      {"o.h5: attribute grid of /scene: expected an integer, found 20.5",
       [](hdf5::Writer& w) { w.attribute("scene", "grid", 20.5); }},
      {"o.h5: attribute gravity of /scene: expected 3 values, found 2 values",
       [](hdf5::Writer& w) {
         w.attribute("scene", "gravity", std::vector<double>{0, 1});
       }},
      {"o.h5: attribute walls of /scene: expected text, found float64",
       [](hdf5::Writer& w) { w.attribute("scene", "walls", 3.0); }},
      {"o.h5: attribute density of /scene: expected a finite number, found inf",
       [](hdf5::Writer& w) { w.attribute("scene", "density", INFINITY); }},
      {"o.h5: attribute correspondence of /x: expected \"points\" where the points are the "
       "particles, found \"none\"",
       [](hdf5::Writer& w) { w.attribute("x", "correspondence", "none"); }},
      {"o.h5: attribute correspondence of /x: expected \"points\" or \"none\", found "
       "\"some\"",
       [](hdf5::Writer& w) {
         w.attribute("/", "version", 2);
         w.attribute("x", "correspondence", "some");
       }},
      {"o.h5: attribute correspondence of /x: expected text, found float64",
       [](hdf5::Writer& w) { w.attribute("x", "correspondence", 1.0); }},
  };
  for (const Case& c : cases) {
    const testing::Scratch scratch;
    hdf5::Writer w(scratch.file("o.h5"));
    w.attribute("/", "format", "uniphy-observation");
    w.attribute("/", "version", 1);
    w.write("x", std::vector<double>(6, 0.5), {2, 1, 3}, info);
    w.write("time", std::vector<double>{0, 1}, {2}, info);
    w.write("volume", std::vector<double>{1}, {1}, info);
    testing::write_scene(w);
    c.spoil(w);
    w.commit();
    EXPECT_EQ(
        testing::without_directory(
            testing::error_of([&] { read_observation(scratch.file("o.h5")); }), scratch.path()),
        c.message);
  }
}

}  // namespace
}  // namespace uniphy
