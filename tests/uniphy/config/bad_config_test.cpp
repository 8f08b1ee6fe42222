// Malformed configurations, each with its whole message.

#include <gtest/gtest.h>

#include <functional>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/config/config.hpp"

namespace uniphy {
namespace {

/// The reader that all cases share.
void read_keys(Section root) {
  Section scene = root.section("scene", "grid and walls");
  scene.integer("grid", 20, at_least(8), "", "nodes a side");
  scene.real_or("auto", "dt", std::nullopt, positive(), "s", "time step");
  scene.vector3("gravity", std::array{0.0, -9.8, 0.0}, any_number(), "m/s^2", "gravity");
  scene.choice("walls", "freeslip", {"freeslip", "noslip"}, "what walls do");
  root.boolean("verbose", false, "prints more");
  root.interval("mu", std::array{1.0, 2.0}, positive(), "Pa", "range");
  root.choices("materials", std::vector<std::string>{"sand"}, {"elastic", "sand"}, "laws");
  root.input_file("model", "", "a trained model");
  for (Section& body : root.list("bodies", "what moves")) {
    body.real("density", 1000, positive(), "kg/m^3", "mass density");
    Section law = body.section("law", "its material");
    law.variant(
        "type", required,
        {{"elastic", "", [](Section& s) { s.real("mu", required, positive(), "Pa", "mu"); }},
         {"sand", "",
          [](Section& s) { s.real("theta", 0.3, between(0, 1.5), "rad", "friction angle"); }}},
        "which law");
  }
  root.optional_section("resume", "goes on from a checkpoint");
}

struct Case {
  const char* name;
  std::string text;
  std::vector<std::string> overrides;
  const char* message;
};

std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

class BadConfig : public ::testing::TestWithParam<Case> {};

TEST_P(BadConfig, IsRefusedWithItsMessage) {
  const testing::Scratch scratch;
  const auto file = scratch.write("c.yaml", GetParam().text);
  const std::string message = testing::error_of([&] {
    const Config config = Config::load(file, GetParam().overrides);
    read_keys(config.root());
    config.finish();
  });
  EXPECT_EQ(testing::without_directory(message, scratch.path()), GetParam().message);
}

const std::vector<Case> kCases{
    // Types and ranges.
    {"IntegerIsText",
     "scene:\n  grid: abc\n",
     {},
     "c.yaml:2: scene.grid: expected an integer >= 8, found \"abc\""},
    {"IntegerIsReal",
     "scene: {grid: 20.5}\n",
     {},
     "c.yaml:1: scene.grid: expected an integer >= 8, found \"20.5\""},
    {"IntegerTooSmall",
     "scene: {grid: 7}\n",
     {},
     "c.yaml:1: scene.grid: expected an integer >= 8, found \"7\""},
    {"IntegerTooLarge",
     "scene: {grid: 99999999999999999999}\n",
     {},
     "c.yaml:1: scene.grid: expected an integer >= 8, found \"99999999999999999999\""},
    {"IntegerQuoted",
     "scene: {grid: '20'}\n",
     {},
     "c.yaml:1: scene.grid: expected an integer >= 8, found the quoted text \"20\""},
    {"IntegerEmpty",
     "scene:\n  grid:\n",
     {},
     "c.yaml:2: scene.grid: expected an integer >= 8, found nothing"},
    {"IntegerIsList",
     "scene: {grid: [20, 20, 20]}\n",
     {},
     "c.yaml:1: scene.grid: expected an integer >= 8, found a list of 3"},
    {"RealNotANumber",
     "scene: {dt: .nan}\n",
     {},
     "c.yaml:1: scene.dt: expected a finite number > 0 or \"auto\" (s), found \".nan\""},
    {"RealInfinite",
     "bodies:\n- law: {type: sand}\n  density: .inf\n",
     {},
     "c.yaml:3: bodies.0.density: expected a finite number > 0 (kg/m^3), found \".inf\""},
    {"RealOverflows",
     "scene: {dt: 1e999}\n",
     {},
     "c.yaml:1: scene.dt: expected a finite number > 0 or \"auto\" (s), found \"1e999\""},
    {"RealNegative",
     "bodies:\n- law: {type: sand}\n  density: -5\n",
     {},
     "c.yaml:3: bodies.0.density: expected a finite number > 0 (kg/m^3), found \"-5\""},
    {"BooleanYes",
     "verbose: yes\n",
     {},
     "c.yaml:1: verbose: expected true or false, found \"yes\""},
    {"VectorShort",
     "scene: {gravity: [0, -9.8]}\n",
     {},
     "c.yaml:1: scene.gravity: expected a list of 3 finite numbers (m/s^2), found a list of 2"},
    {"VectorScalar",
     "scene: {gravity: -9.8}\n",
     {},
     "c.yaml:1: scene.gravity: expected a list of 3 finite numbers (m/s^2), found \"-9.8\""},
    {"VectorElement",
     "scene:\n  gravity: [0,\n    down, 0]\n",
     {},
     "c.yaml:3: scene.gravity.1: expected a finite number (m/s^2), found \"down\""},
    {"IntervalReversed",
     "mu: [3, 2]\n",
     {},
     "c.yaml:1: mu: expected [low, high] with low <= high, found [3, 2]"},
    {"ChoiceUnknown",
     "scene: {walls: sticky}\n",
     {},
     "c.yaml:1: scene.walls: expected one of freeslip, noslip, found \"sticky\""},
    {"ChoicesTwice",
     "materials: [sand, sand]\n",
     {},
     "c.yaml:1: materials: expected each name once, found \"sand\" twice"},
    {"ChoicesUnknown",
     "materials: [sand, snow]\n",
     {},
     "c.yaml:1: materials.1: expected a name from elastic, sand, found \"snow\""},
    {"SectionIsScalar", "scene: 3\n", {}, "c.yaml:1: scene: expected a map, found \"3\""},
    {"ListIsMap",
     "bodies: {density: 3}\n",
     {},
     "c.yaml:1: bodies: expected a list of maps, found a map"},
    {"ListElement", "bodies:\n- 3\n", {}, "c.yaml:2: bodies.0: expected a map, found \"3\""},
    {"FileMissing",
     "model: nowhere/model.h5\n",
     {},
     "c.yaml:1: model: expected a file, found \"nowhere/model.h5\", which does not exist"},
    {"FileIsDirectory",
     "model: /\n",
     {},
     "c.yaml:1: model: expected a file, found \"/\", which is a directory"},
    // Required and unknown keys.
    {"RequiredMissing",
     "bodies:\n- density: 3\n  law: {type: elastic}\n",
     {},
     "c.yaml:3: bodies.0.law.mu: required key is missing, expected a finite number > 0 (Pa)"},
    {"RequiredMisspelt",
     "bodies:\n- law: {type: elastic,\n   nu: 5}\n",
     {},
     "c.yaml:2: bodies.0.law.mu: required key is missing, expected a finite number > 0 (Pa); found "
     "\"nu\" (c.yaml:3)"},
    {"VariantUnknown",
     "bodies:\n- law: {type: jelly}\n",
     {},
     "c.yaml:2: bodies.0.law.type: expected one of elastic, sand, found \"jelly\""},
    {"KeyOfAnotherVariant",
     "bodies:\n- law: {type: sand, lambda: 5}\n",
     {},
     "c.yaml:2: bodies.0.law.lambda: unknown key; known keys here: type, theta"},
    {"UnknownKeyNear",
     "scene:\n  gird: 20\n",
     {},
     "c.yaml:2: scene.gird: unknown key; did you mean \"grid\"?"},
    {"UnknownKeyFar",
     "colour: red\n",
     {},
     "c.yaml:1: colour: unknown key; known keys here: scene, verbose, mu, materials, model, "
     "bodies, "
     "resume"},
    {"UnknownOptionalSection",
     "resum: {}\n",
     {},
     "c.yaml:1: resum: unknown key; did you mean \"resume\"?"},
    // YAML itself.
    {"DuplicateKey",
     "verbose: true\nmu: [1, 2]\nverbose: false\n",
     {},
     "c.yaml:3: key \"verbose\" is given twice (first at c.yaml:1)"},
    {"Alias",
     "mu: &m [1, 2]\n",
     {},
     "c.yaml:1: YAML anchors (&name) are not supported; write the value out"},
    {"Tag",
     "mu: !!python/object:os.system [1, 2]\n",
     {},
     "c.yaml:1: YAML tags are not supported, found \"tag:yaml.org,2002:python/object:os.system\""},
    {"TwoDocuments",
     "verbose: true\n---\nverbose: false\n",
     {},
     "c.yaml: expected one YAML document, found two"},
    {"Tab", "scene:\n\tgrid: 20\n", {}, "c.yaml:2: expected blanks as indentation, found a tab"},
    {"NotUtf8",
     "verbose: true\n# caf\xE9\n",
     {},
     "c.yaml:2: expected UTF-8 text, found the byte 0xe9"},
    {"Utf16",
     std::string("\xFF\xFEv\0e\0", 6),
     {},
     "c.yaml:1: expected UTF-8 text, found the byte 0xff"},
    {"Binary",
     std::string("\x7f"
                 "ELF\0\0\1",
                 7),
     {},
     "c.yaml:1: expected text, found the control character 0x7f"},
    {"Unclosed", "scene: {grid: 20\n", {}, "c.yaml:2: not valid YAML: end of map flow not found"},
    {"TopLevelList", "- 1\n- 2\n", {}, "c.yaml:1: expected a map of keys, found a list of 2"},
    {"TopLevelText", "hello\n", {}, "c.yaml:1: expected a map of keys, found \"hello\""},
    {"MapAsKey",
     "? {a: 1}\n: 2\n",
     {},
     "c.yaml:1: expected a plain key, found a list or a map; is a bracket left open?"},
    {"TooDeep",
     "mu: " + std::string(40, '[') + std::string(40, ']'),
     {},
     "c.yaml:1: expected at most 32 nested levels"},
    {"TooBig",
     std::string((1 << 20) + 1, '#'),
     {},
     "c.yaml: expected at most 1048576 bytes, found more"},
    // Overrides.
    {"OverrideWithoutEquals", "", {"scene.grid"}, "--set scene.grid: expected key.path=value"},
    {"OverrideEmptyKey",
     "",
     {"scene..grid=3"},
     "--set scene..grid=3: expected key.path=value, found an empty key in the path"},
    {"OverrideType",
     "",
     {"scene.grid=few"},
     "--set scene.grid=few: scene.grid: expected an integer >= 8, found \"few\""},
    {"OverrideUnknown",
     "",
     {"scene.girds=20"},
     "--set scene.girds=20: scene.girds: unknown key; did you mean \"grid\"?"},
    {"OverrideIndex",
     "bodies:\n- law: {type: sand}\n",
     {"bodies.4.density=3"},
     "--set bodies.4.density=3: bodies: expected an index from 0 to 1 of a list, found \"4\""},
    {"OverrideIndexHuge",
     "bodies:\n- law: {type: sand}\n",
     {"bodies.99999999999999999999.density=3"},
     "--set bodies.99999999999999999999.density=3: bodies: expected an index from 0 to 1 of a "
     "list, "
     "found \"99999999999999999999\""},
    {"OverrideIntoScalar",
     "verbose: true\n",
     {"verbose.level=3"},
     "--set verbose.level=3: verbose: expected a map or a list, found \"true\""},
    {"OverrideNotYaml",
     "",
     {"mu=[1, 2"},
     "--set mu=[1, 2: expected a plain key, found a list or a map; is a bracket left open?"},
};

INSTANTIATE_TEST_SUITE_P(Yaml, BadConfig, ::testing::ValuesIn(kCases),
                         [](const auto& info) { return info.param.name; });

TEST(BadConfigFile, MissingFileAndDirectory) {
  const testing::Scratch scratch;
  const auto message = [&](const std::string& name) {
    return testing::without_directory(testing::error_of([&] { Config::load(scratch.file(name)); }),
                                      scratch.path());
  };
  EXPECT_EQ(message("none.yaml"), "none.yaml: expected a file, found nothing of that name");
  std::filesystem::create_directory(scratch.file("folder.yaml"));
  EXPECT_EQ(message("folder.yaml"), "folder.yaml: expected a file, found a directory");
}

}  // namespace
}  // namespace uniphy
