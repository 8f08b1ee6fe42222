#include "uniphy/io/observation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/hdf5.hpp"

namespace uniphy {
namespace {

Observation example() {
  Observation o;
  o.frames = 3;
  o.particles = 2;
  for (int i = 0; i < 18; ++i) o.x.push_back(0.01 * i);
  o.time = {0, 0.1, 0.2};
  o.volume = {1e-6, 2e-6};
  o.grid = 32;
  o.dt = 2.5e-4;
  o.gravity = {0, -1.6, 0.1};
  o.walls = "noslip";
  o.bound = 4;
  o.density = 1500;
  return o;
}

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

/// Clouds of 2, 0 and 1 points in two rows beside three particles.
Observation cloud_example() {
  Observation o = example();
  o.body = {0.1, 0.1, 0.1, 0.2, 0.1, 0.1, 0.1, 0.3, 0.1};
  o.particles = 3;
  o.volume = {1e-6, 2e-6, 3e-6};
  o.cloud = 2;
  std::fill(o.x.begin() + 6, o.x.begin() + 15, std::nan(""));
  return o;
}

/// A position as itself, NaN as a number that is none.
std::vector<double> comparable(std::vector<double> x) {
  for (double& v : x) v = std::isnan(v) ? -1 : v;
  return x;
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

/// A body whose points are its particles and a cloud beside another, of another density.
std::vector<ObservedBody> two_bodies() {
  std::vector<ObservedBody> bodies{{"lump", example()}, {"gear", cloud_example()}};
  bodies[1].motion.density = 800;
  bodies[1].motion.noise = 1e-3;
  return bodies;
}

TEST(Observation, SeveralBodiesReadBackInTheOrderOfTheirNames) {
  const testing::Scratch scratch;
  const std::vector<ObservedBody> written = two_bodies();
  write_observed_bodies(scratch.file("o.h5"), written);
  const std::vector<ObservedBody> read = read_observed_bodies(scratch.file("o.h5"));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].name, "gear");
  EXPECT_EQ(read[1].name, "lump");
  for (int b = 0; b < 2; ++b) {
    const Observation &found = read[b].motion, &expected = written[1 - b].motion;
    EXPECT_EQ(comparable(found.x), comparable(expected.x));
    EXPECT_EQ(found.time, expected.time);
    EXPECT_EQ(found.volume, expected.volume);
    EXPECT_EQ(found.body, expected.body);
    EXPECT_EQ(found.cloud, expected.cloud);
    EXPECT_EQ(found.density, expected.density);
    EXPECT_EQ(found.walls, expected.walls);
  }
  EXPECT_EQ(read[0].motion.noise, 1e-3);
  EXPECT_TRUE(std::isnan(read[1].motion.noise));
  EXPECT_EQ(testing::without_directory(
                testing::error_of([&] { read_observation(scratch.file("o.h5")); }), scratch.path()),
            "o.h5: /bodies: expected one body, found 2 (gear, lump)");
}

TEST(Observation, AFileOfOneBodyIsThatBody) {
  const testing::Scratch scratch;
  write_observed_bodies(scratch.file("o.h5"), {{"", example()}});
  const std::vector<ObservedBody> read = read_observed_bodies(scratch.file("o.h5"));
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(read[0].name, "");
  EXPECT_EQ(hdf5::Reader(scratch.file("o.h5")).attribute_integer("/", "version"), 1);
  EXPECT_EQ(read_observation(scratch.file("o.h5")).x, example().x);
}

TEST(Observation, BadBodiesAreRefused) {
  const testing::Scratch scratch;
  const auto error = [&](const std::function<void(std::vector<ObservedBody>&)>& spoil) {
    std::vector<ObservedBody> bodies = two_bodies();
    spoil(bodies);
    return testing::without_directory(
        testing::error_of([&] { write_observed_bodies(scratch.file("o.h5"), bodies); }),
        scratch.path());
  };
  EXPECT_EQ(error([](auto& b) { b[1].motion.dt = 1e-3; }),
            "o.h5: /bodies/gear: expected the times and the scene of the first body, found others");
  EXPECT_EQ(error([](auto& b) { b[1].name = "lump"; }),
            "o.h5: /bodies/lump: expected a name of its own of letters, digits, _, - and . (no dot "
            "first)");
  EXPECT_EQ(
      error([](auto& b) { b[1].name = "../gear"; }),
      "o.h5: /bodies/../gear: expected a name of its own of letters, digits, _, - and . (no dot "
      "first)");
  EXPECT_EQ(error([](auto& b) { b[1].motion.volume[0] = -1; }),
            "o.h5: /body/volume in /bodies/gear: expected volumes > 0, found -1");
  EXPECT_EQ(error([](auto& b) { b.clear(); }), "o.h5: /bodies: expected bodies, found none");
  EXPECT_FALSE(std::filesystem::exists(scratch.file("o.h5")));
}

TEST(Observation, BadFilesOfSeveralBodiesAreRefused) {
  struct Case {
    std::string message;
    std::function<void(hdf5::Writer&)> spoil;
  };
  const hdf5::Info info{"1", ""};
  const auto lump = [&](hdf5::Writer& w) {
    w.write("bodies/lump/x", std::vector<double>(6, 0.5), {2, 1, 3}, info);
    w.write("bodies/lump/volume", std::vector<double>{1e-3}, {1}, info);
  };
  const std::vector<Case> cases{
      {"o.h5: /bodies: expected bodies, found none", [](hdf5::Writer& w) { w.group("bodies"); }},
      {"o.h5: /: expected /x or /bodies, found both",
       [&](hdf5::Writer& w) {
         lump(w);
         w.write("x", std::vector<double>(6, 0.5), {2, 1, 3}, info);
       }},
      {"o.h5: /bodies/gear/x: expected a dataset, found nothing of that name",
       [&](hdf5::Writer& w) {
         lump(w);
         w.group("bodies/gear");
       }},
      {"o.h5: attribute density of /scene in /bodies/lump: expected a density of 0.001 to 1000000 "
       "kg/m^3, found 0",
       [&](hdf5::Writer& w) {
         lump(w);
         w.attribute("bodies/lump", "density", 0.0);
       }},
      {"o.h5: /bodies/a lump: expected a name of letters, digits, _, - and . (no dot first)",
       [&](hdf5::Writer& w) {
         w.write("bodies/a lump/x", std::vector<double>(6, 0.5), {2, 1, 3}, info);
       }},
  };
  for (const Case& c : cases) {
    const testing::Scratch scratch;
    hdf5::Writer w(scratch.file("o.h5"));
    w.attribute("/", "format", "uniphy-observation");
    w.attribute("/", "version", 2);
    w.write("time", std::vector<double>{0, 1}, {2}, info);
    w.group("scene");
    w.attribute("scene", "grid", 20);
    w.attribute("scene", "dt", 1e-3);
    w.attribute("scene", "gravity", std::vector<double>{0, -9.8, 0});
    w.attribute("scene", "walls", "freeslip");
    w.attribute("scene", "bound", 3);
    w.attribute("scene", "density", 1000.0);
    c.spoil(w);
    w.commit();
    EXPECT_EQ(
        testing::without_directory(
            testing::error_of([&] { read_observed_bodies(scratch.file("o.h5")); }), scratch.path()),
        c.message);
  }
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
    w.group("scene");
    w.attribute("scene", "grid", 20);
    w.attribute("scene", "dt", 1e-3);
    w.attribute("scene", "gravity", std::vector<double>{0, -9.8, 0});
    w.attribute("scene", "walls", "freeslip");
    w.attribute("scene", "bound", 3);
    w.attribute("scene", "density", 1000.0);
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
