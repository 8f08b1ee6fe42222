#include "uniphy/config/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A reader with every kind of key, as a binary would write it.
struct Example {
  std::int64_t grid = 0;
  std::optional<double> dt;
  std::array<double, 3> gravity{};
  std::string walls;
  bool verbose = false;
  std::vector<std::int64_t> hidden;
  std::vector<std::string> materials;
  std::array<double, 2> mu_range{};
  struct Body {
    std::string shape;
    double radius = 0;
    std::array<double, 3> size{};
    double density = 0;
  };
  std::vector<Body> bodies;
  bool has_resume = false;
};

Example read_example(Section root) {
  Example example;
  Section scene = root.section("scene", "grid and walls");
  example.grid = scene.integer("grid", 20, between(8, 1024), "nodes", "nodes a side");
  example.dt = scene.real_or("auto", "dt", std::nullopt, positive(), "s", "time step");
  example.gravity =
      scene.vector3("gravity", std::array{0.0, -9.8, 0.0}, any_number(), "m/s^2", "gravity");
  example.walls = scene.choice("walls", "freeslip", {"freeslip", "noslip"}, "what walls do");
  example.verbose = root.boolean("verbose", false, "prints more");
  example.hidden = root.integers("hidden", std::vector<std::int64_t>{32, 32}, between(1, 4096), "",
                                 "widths", between(1, 8));
  example.materials =
      root.choices("materials", std::vector<std::string>{"elastic"}, {"elastic", "sand"}, "laws");
  example.mu_range =
      root.interval("mu", std::array{1e4, 1e6}, positive(), "Pa", "range of the shear modulus");
  for (Section& body : root.list("bodies", "what moves", at_least(1))) {
    Example::Body read;
    Section shape = body.section("shape", "its form");
    read.shape = shape.variant(
        "type", required,
        {{"box", "a cuboid",
          [&](Section& s) { read.size = s.vector3("size", required, positive(), "m", "sides"); }},
         {"sphere", "a ball",
          [&](Section& s) { read.radius = s.real("radius", 0.2, positive(), "m", "radius"); }},
         {"cylinder", "upright",
          [&](Section& s) { read.radius = s.real("radius", 0.2, positive(), "m", "radius"); }}},
        "which shape");
    read.density = body.real("density", 1000, positive(), "kg/m^3", "mass density");
    example.bodies.push_back(read);
  }
  if (auto resume = root.optional_section("resume", "goes on from a checkpoint")) {
    example.has_resume = true;
    resume->text("file", "checkpoint.h5", "the checkpoint");
  }
  return example;
}

constexpr const char* kMinimal = "bodies:\n  - shape: {type: sphere}\n";

TEST(Config, DefaultsFillWhatTheDocumentLeavesOut) {
  const Config config = Config::parse(kMinimal);
  const Example example = read_example(config.root());
  config.finish();
  EXPECT_EQ(example.grid, 20);
  EXPECT_FALSE(example.dt.has_value());
  EXPECT_EQ(example.gravity[1], -9.8);
  EXPECT_EQ(example.walls, "freeslip");
  EXPECT_THAT(example.hidden, ElementsAre(32, 32));
  ASSERT_EQ(example.bodies.size(), 1u);
  EXPECT_EQ(example.bodies[0].radius, 0.2);
  EXPECT_FALSE(example.has_resume);
}

TEST(Config, ReadsWhatTheDocumentGives) {
  const Config config = Config::parse(
      "scene: {grid: 64, dt: 5e-4, gravity: [0, 0, -1], walls: noslip}\nverbose: true\n"
      "hidden: [128]\nmaterials: [sand, elastic]\nmu: [1, 2]\nresume:\nbodies:\n"
      "  - shape: {type: box, size: [1, 2, 3]}\n    density: 7\n  - shape: {type: cylinder}\n");
  const Example example = read_example(config.root());
  config.finish();
  EXPECT_EQ(example.grid, 64);
  EXPECT_EQ(example.dt, 5e-4);
  EXPECT_EQ(example.gravity[2], -1);
  EXPECT_TRUE(example.verbose);
  EXPECT_THAT(example.materials, ElementsAre("sand", "elastic"));
  ASSERT_EQ(example.bodies.size(), 2u);
  EXPECT_EQ(example.bodies[0].size[2], 3);
  EXPECT_EQ(example.bodies[0].density, 7);
  EXPECT_EQ(example.bodies[1].shape, "cylinder");
  EXPECT_TRUE(example.has_resume);
}

TEST(Config, OverridesComeBeforeValidation) {
  const Config config = Config::parse("scene: {grid: 4}\n" + std::string(kMinimal), "f",
                                      {"scene.grid=10", "bodies.0.density=500"});
  const Example example = read_example(config.root());
  EXPECT_EQ(example.grid, 10);
  EXPECT_EQ(example.bodies[0].density, 500);
}

TEST(Config, ResolvedDocumentReadsBackToTheSameValues) {
  const Config once =
      Config::parse("scene: {grid: 9, dt: 1e-4}\nresume: {}\n" + std::string(kMinimal));
  read_example(once.root());
  const std::string resolved = once.resolved();
  EXPECT_THAT(resolved, HasSubstr("density: 1000"));
  EXPECT_THAT(resolved, HasSubstr("gravity: [0, -9.8, 0]"));
  const Config twice = Config::parse(resolved);
  const Example example = read_example(twice.root());
  twice.finish();
  EXPECT_EQ(example.grid, 9);
  EXPECT_EQ(example.dt, 1e-4);
  EXPECT_TRUE(example.has_resume);
  EXPECT_EQ(twice.resolved(), resolved);
}

TEST(Config, DescribingListsEveryKeyOfEveryAlternative) {
  const Config config = Config::describe();
  read_example(config.root());
  config.finish();
  std::vector<std::string> paths;
  for (const KeyInfo& key : config.keys()) paths.push_back(key.path);
  EXPECT_THAT(paths,
              ElementsAre("scene", "scene.grid", "scene.dt", "scene.gravity", "scene.walls",
                          "verbose", "hidden", "materials", "mu", "bodies", "bodies[].shape",
                          "bodies[].shape.type", "bodies[].shape.size", "bodies[].shape.radius",
                          "bodies[].density", "resume", "resume.file"));
  const KeyInfo& radius = config.keys()[13];
  EXPECT_EQ(radius.when, "type: sphere | cylinder");
  EXPECT_EQ(radius.unit, "m");
  EXPECT_EQ(radius.fallback, "0.2");
  EXPECT_EQ(config.keys()[12].fallback, "required");
  EXPECT_EQ(config.keys()[1].type, "integer in [8, 1024]");
  EXPECT_EQ(config.keys()[2].fallback, "auto");
}

TEST(Config, TableKeepsItsWidth) {
  const Config config = Config::describe();
  read_example(config.root());
  std::istringstream lines(config.table(90));
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) EXPECT_LE(line.size(), 90u) << line;
  EXPECT_GT(count, 20);
}

TEST(Config, DeclaringAKeyTwiceIsAProgrammingError) {
  for (const Config& config : {Config::parse("a: 1\n"), Config::describe()}) {
    Section root = config.root();
    root.integer("a", 1, any_number(), "", "doc");
    EXPECT_THROW(root.integer("a", 1, any_number(), "", "doc"), std::logic_error);
  }
}

TEST(Config, DefaultOutOfItsRangeIsAProgrammingError) {
  Section root = Config::describe().root();
  EXPECT_THROW(root.integer("a", 1, at_least(2), "", "doc"), std::logic_error);
  EXPECT_THROW(root.choice("b", "x", {"y"}, "doc"), std::logic_error);
  EXPECT_THROW(root.reals("c", std::vector<double>{-1.0}, positive(), "", "doc"), std::logic_error);
}

TEST(Config, SectionFailNamesThePlace) {
  const Config config = Config::parse("\n\nscene:\n  grid: 20\n", "f.yaml");
  Section scene = config.root().section("scene", "doc");
  EXPECT_EQ(testing::error_of([&] { scene.fail("grid", "too coarse for the shape"); }),
            "f.yaml:4: scene.grid: too coarse for the shape");
}

TEST(Config, TextThatLooksLikeANumberStaysText) {
  for (const char* text :
       {"1:30",  "1:20:30.5", "0x1F", "0b1",   "017",  "1_000", "-1_0", "2001-01-01",
        "yes",   "no",        "On",   "OFF",   "True", "y",     "Null", "~",
        "5e-05", ".5",        ".inf", "-.INF", ".nan", "=",     "<<"}) {
    const Config config = Config::parse(std::string("name: \"") + text + "\"\n");
    EXPECT_EQ(config.root().text("name", "", "doc"), text);
    EXPECT_EQ(config.resolved(), std::string("name: \"") + text + "\"\n");
  }
}

TEST(Config, AnEmptyOverrideTakesAKeyBack) {
  const Config config = Config::parse("grid: 9\nheldout: missing.h5\nresume: {}\n", "f.yaml",
                                      {"grid=", "heldout=", "resume=none"});
  Section root = config.root();
  EXPECT_EQ(root.integer("grid", 20, any_number(), "", "doc"), 20);
  EXPECT_EQ(root.input_file("heldout", "", "doc"), "");
  EXPECT_FALSE(root.optional_section("resume", "doc").has_value());
  config.finish();
}

TEST(Config, WhatIsTakenBackIsAsIfItStoodNotInTheDocument) {
  const std::string text =
      "scene: {grid: 9}\nresume: {file: a}\nbodies:\n"
      "  - {shape: {type: box, size: [1, 2, 3]}, density: 7}\n  - shape: {type: sphere}\n";
  const Config config = Config::parse(
      text, "f.yaml",
      {"scene=null", "resume=null", "bodies.1=null", "bodies.0.shape.type=sphere",
       // Of the box, which is one no more; and what is known, but not given.
       "bodies.0.shape.size=null", "verbose=null", "resume.file=null", "bodies.0.shape.radius="});
  const Example example = read_example(config.root());
  config.finish();
  EXPECT_EQ(example.grid, 20);
  EXPECT_FALSE(example.has_resume);
  ASSERT_EQ(example.bodies.size(), 1u);
  EXPECT_EQ(example.bodies[0].radius, 0.2);
  EXPECT_EQ(example.bodies[0].density, 7);

  // Required keys: the error of a document that lacks them.
  const auto message = [](const std::string& document, const std::vector<std::string>& overrides) {
    return testing::error_of(
        [&] { read_example(Config::parse(document, "f.yaml", overrides).root()); });
  };
  EXPECT_EQ(message(text, {"bodies=null"}), message("scene: {}\n", {}));
  EXPECT_EQ(message(text, {"bodies.1=null", "bodies.0=null"}), message("\n\nbodies: []\n", {}));
  EXPECT_EQ(
      message("bodies:\n  - shape: {type: box, size: [1, 2, 3]}\n", {"bodies.0.shape.size=null"}),
      message("bodies:\n  - shape: {type: box}\n", {}));
}

TEST(Config, AnEmptyOverrideOfAnUnknownKeyIsRefused) {
  for (const char* assignment : {"scene.gird=null", "bodies.0.shape.size=null"}) {
    const Config config = Config::parse(kMinimal, "f.yaml", {assignment});
    read_example(config.root());
    const std::string path = std::string(assignment).substr(0, std::string(assignment).find('='));
    EXPECT_EQ(testing::error_of([&] { config.finish(); }),
              std::string("--set ") + assignment + ": " + path + ": unknown key");
  }
  const Config config = Config::parse("grid: 9\n", "f.yaml", {"gird="});
  config.root().integer("grid", 20, any_number(), "", "doc");
  EXPECT_EQ(testing::error_of([&] { config.finish(); }), "--set gird=: gird: unknown key");
}

TEST(Config, NoneIsNoFile) {
  const Config config = Config::parse("heldout: missing.h5\n", "f.yaml", {"heldout=none"});
  EXPECT_EQ(config.root().input_file("heldout", "", "doc"), "");
  const Config needed = Config::parse("file: none\n", "f.yaml");
  EXPECT_EQ(testing::error_of([&] { needed.root().input_file("file", required, "doc"); }),
            "f.yaml:1: file: expected a file, found \"none\", which does not exist");
}

TEST(Config, KeysThatExcludeEachOther) {
  const auto read = [](const Config& config) {
    Section root = config.root();
    const auto length =
        root.real_or("none", "length", std::optional<double>(), positive(), "m", "doc");
    const auto count = root.integer("count", 5, any_number(), "", "doc");
    root.one_of("length", "count");
    config.finish();
    return length.value_or(static_cast<double>(count));
  };
  EXPECT_EQ(read(Config::parse("count: 7\n")), 7);
  EXPECT_EQ(read(Config::parse("length: 2\n")), 2);
  EXPECT_EQ(read(Config::parse("length: none\ncount: 7\n")), 7);
  EXPECT_EQ(testing::error_of([&] { read(Config::parse("count: 7\n", "f.yaml", {"length=2"})); }),
            "--set length=2: length: expected this or count, found both (f.yaml:1: \"7\")");
}

}  // namespace
}  // namespace uniphy
