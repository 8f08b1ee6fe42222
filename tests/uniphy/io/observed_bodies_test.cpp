// Observations of several bodies in one file.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/uniphy/io/observation_examples.hpp"
#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using testing::cloud_example;
using testing::comparable;
using testing::example;

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
    testing::write_scene(w);
    c.spoil(w);
    w.commit();
    EXPECT_EQ(
        testing::without_directory(
            testing::error_of([&] { read_observed_bodies(scratch.file("o.h5")); }), scratch.path()),
        c.message);
  }
}

}  // namespace
}  // namespace uniphy
