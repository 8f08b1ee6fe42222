// Whether documents keep to schemas is the business of schema_test.py.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "uniphy/config/config.hpp"

namespace uniphy {
namespace {

using Json = nlohmann::ordered_json;

template <class Read>
Json schema_of(const Read& read) {
  const Config config = Config::describe();
  Section root = config.root();
  read(root);
  return Json::parse(config.schema("uniphy_example", "Adds numbers."));
}

TEST(Schema, ValuesHaveTypeRangeDefaultUnitAndText) {
  const Json schema = schema_of([](Section& root) {
    root.boolean("verbose", false, "prints more");
    root.integer("grid", 20, between(8, 1024), "nodes", "nodes a side");
    root.real("density", required, positive(), "kg/m^3", "mass density");
    root.real("share", 0.25, Range{0, 1, true, true}, "", "");
    root.real_or("auto", "dt", std::nullopt, at_most(1), "s", "time step");
    root.text("name", "7", "how it is called");
    root.choice("walls", "freeslip", {"freeslip", "noslip"}, "what walls do");
    root.input_file("file", "", "what is read");
    root.vector3("gravity", std::array{0.0, -9.8, 0.0}, any_number(), "m/s^2", "");
    root.integers("hidden", std::vector<std::int64_t>{32}, at_least(1), "", "", between(1, 8));
    root.choices("laws", required, {"elastic", "sand"}, "which");
  });
  EXPECT_EQ(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
  EXPECT_EQ(schema["title"], "uniphy_example");
  EXPECT_EQ(schema["description"], "Adds numbers.");
  EXPECT_EQ(schema["type"], "object");
  EXPECT_EQ(schema["additionalProperties"], false);
  EXPECT_EQ(schema["required"], Json({"density", "laws"}));
  const Json expected = Json::parse(R"json({
    "verbose": {"type": "boolean", "description": "prints more", "default": false},
    "grid": {"type": "integer", "minimum": 8, "maximum": 1024,
             "description": "nodes a side (nodes)", "default": 20},
    "density": {"type": "number", "exclusiveMinimum": 0, "description": "mass density (kg/m^3)"},
    "share": {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1, "default": 0.25},
    "dt": {"anyOf": [{"type": "number", "maximum": 1}, {"const": "auto"}],
           "description": "time step (s)", "default": "auto"},
    "name": {"type": ["string", "number", "boolean"], "description": "how it is called",
             "default": "7"},
    "walls": {"enum": ["freeslip", "noslip"], "description": "what walls do",
              "default": "freeslip"},
    "file": {"type": ["string", "number", "boolean"], "description": "what is read",
             "default": ""},
    "gravity": {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3,
                "description": "m/s^2", "default": [0, -9.8, 0]},
    "hidden": {"type": "array", "items": {"type": "integer", "minimum": 1}, "minItems": 1,
               "maxItems": 8, "default": [32]},
    "laws": {"type": "array", "items": {"enum": ["elastic", "sand"]}, "uniqueItems": true,
             "description": "which"}
  })json");
  EXPECT_EQ(schema["properties"], expected) << schema["properties"].dump(2);
}

TEST(Schema, MapsAreRequiredWhereTheyLackSomething) {
  const Json schema = schema_of([](Section& root) {
    Section scene = root.section("scene", "all defaults");
    scene.integer("grid", 20, any_number(), "", "");
    Section body = root.section("body", "lacks a density");
    body.real("density", required, positive(), "", "");
    auto resume = root.optional_section("resume", "goes on");
    resume->text("file", required, "");
    Section entry = root.list("bodies", "what moves", at_least(1)).front();
    entry.real("density", 1, positive(), "", "");
    root.list("more", "what else").front().real("x", 0, any_number(), "", "");
  });
  EXPECT_EQ(schema["required"], Json({"body", "bodies"}));
  const Json& keys = schema["properties"];
  EXPECT_EQ(keys["scene"]["type"], Json({"object", "null"}));
  EXPECT_EQ(keys["scene"]["description"], "all defaults");
  EXPECT_EQ(keys["body"]["type"], "object");
  EXPECT_EQ(keys["resume"]["anyOf"][0]["required"], Json::array({"file"}));
  EXPECT_EQ(keys["resume"]["anyOf"][1], Json({{"const", "none"}}));
  EXPECT_EQ(keys["bodies"]["minItems"], 1);
  EXPECT_EQ(keys["bodies"]["items"]["type"], "object");
  EXPECT_EQ(keys["bodies"]["items"]["additionalProperties"], false);
  EXPECT_EQ(keys["more"]["default"], Json::array());
}

TEST(Schema, AlternativesOfAVariantStandApart) {
  const Json schema = schema_of([](Section& root) {
    root.real("size", 1, positive(), "m", "of all shapes");
    root.variant(
        "type", "box",
        {{"box", "a cuboid", [](Section& s) { s.vector3("sides", required, positive(), "m", ""); }},
         {"ball", "a sphere",
          [](Section& s) {
            s.variant("of", required, {{"clay", "", nullptr}, {"ice", "", nullptr}}, "");
          }}},
        "which shape");
    root.boolean("last", true, "after the variant");
  });
  ASSERT_EQ(schema["oneOf"].size(), 3u) << schema.dump(2);
  EXPECT_FALSE(schema.contains("properties"));
  const Json& box = schema["oneOf"][0];
  EXPECT_EQ(box["title"], "type: box");
  EXPECT_EQ(box["description"], "a cuboid");
  // The default need not be named, what it requires has to be there.
  EXPECT_EQ(box["required"], Json::array({"sides"}));
  EXPECT_EQ(box["properties"]["type"],
            Json({{"const", "box"}, {"description", "a cuboid"}, {"default", "box"}}));
  EXPECT_TRUE(box["properties"].contains("size"));
  EXPECT_TRUE(box["properties"].contains("last"));
  EXPECT_FALSE(box["properties"].contains("of"));
  const Json& ice = schema["oneOf"][2];
  EXPECT_EQ(ice["title"], "type: ball, of: ice");
  EXPECT_EQ(ice["required"], Json({"type", "of"}));
  EXPECT_EQ(ice["properties"]["of"], Json({{"const", "ice"}}));
  EXPECT_FALSE(ice["properties"].contains("sides"));
  EXPECT_EQ(ice["additionalProperties"], false);
}

}  // namespace
}  // namespace uniphy
