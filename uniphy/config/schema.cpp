#include "uniphy/config/schema.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace uniphy {
namespace {

using Json = nlohmann::ordered_json;

/// Whole numbers without a point.
Json number(double value) {
  constexpr double kExact = 9007199254740992;
  if (value == std::floor(value) && std::abs(value) < kExact)
    return static_cast<std::int64_t>(value);
  return value;
}

Json number_schema(const char* type, const Range& range) {
  Json schema{{"type", type}};
  if (std::isfinite(range.low))
    schema[range.low_open ? "exclusiveMinimum" : "minimum"] = number(range.low);
  if (std::isfinite(range.high))
    schema[range.high_open ? "exclusiveMaximum" : "maximum"] = number(range.high);
  return schema;
}

void add_sizes(Json& schema, const Range& sizes) {
  if (sizes.low > 0) schema["minItems"] = number(std::ceil(sizes.low));
  if (std::isfinite(sizes.high)) schema["maxItems"] = number(std::floor(sizes.high));
}

Json value_of(const Node& node) {
  if (node.kind == Node::Kind::null) return nullptr;
  if (node.kind == Node::Kind::list) {
    Json list = Json::array();
    for (const auto& item : node.items) list.push_back(value_of(*item));
    return list;
  }
  if (node.quoted) return node.text;
  if (const auto value = parse_boolean(node.text)) return *value;
  if (const auto value = parse_integer(node.text)) return *value;
  if (const auto value = parse_real(node.text); value && std::isfinite(*value)) return *value;
  return node.text;
}

bool is_required(const SchemaMap::Property& property);

/// Whether a map that is not there at all lacks something: maps of keys with defaults may be
/// absent.
bool needs_keys(const SchemaMap& map) {
  for (const SchemaMap::Property& property : map.properties) {
    if (is_required(property)) return true;
  }
  for (const SchemaMap::Choice& choice : map.choices) {
    for (const SchemaMap::Property& property : map.properties) {
      if (property.key != choice.key) continue;
      const std::string chosen =
          value_of(*parse_document("k: " + property.fallback, "")->find("k"));
      for (const SchemaMap::Alternative& alternative : choice.alternatives) {
        if (alternative.name == chosen && needs_keys(*alternative.map)) return true;
      }
    }
  }
  return false;
}

bool is_required(const SchemaMap::Property& property) {
  if (property.form == SchemaMap::Form::section) return needs_keys(*property.map);
  return property.fallback == "required";
}

Json map_schema(const SchemaMap& map, bool may_be_empty);

Json property_schema(const SchemaMap::Property& property) {
  Json schema = Json::object();
  switch (property.form) {
    case SchemaMap::Form::value:
      schema = Json::parse(property.value);
      break;
    case SchemaMap::Form::section:
      schema = map_schema(*property.map, true);
      break;
    case SchemaMap::Form::optional_section:
      schema["anyOf"] = {map_schema(*property.map, true), {{"const", "none"}}};
      break;
    case SchemaMap::Form::list:
      schema["type"] = "array";
      schema["items"] = map_schema(*property.map, false);
      add_sizes(schema, property.sizes);
      break;
  }
  std::string text = property.doc;
  if (!property.unit.empty())
    text = text.empty() ? property.unit : text + " (" + property.unit + ")";
  if (!text.empty()) schema["description"] = text;
  if (!property.fallback.empty() && property.fallback != "required")
    schema["default"] = value_of(*parse_document("k: " + property.fallback, "")->find("k"));
  return schema;
}

/// One set of keys that may stand together in a map: one alternative of every variant is chosen.
struct Keys {
  std::string title, doc;
  std::vector<std::pair<std::string, Json>> properties;
  std::vector<std::string> required;

  void set(const std::string& key, const Json& schema) {
    for (auto& [name, value] : properties) {
      if (name == key) {
        value = schema;
        return;
      }
    }
    properties.emplace_back(key, schema);
  }
  void require(const std::string& key) {
    if (std::find(required.begin(), required.end(), key) == required.end()) required.push_back(key);
  }
};

void add_note(std::string& text, const std::string& more, const char* between) {
  if (!more.empty()) text += (text.empty() ? "" : between) + more;
}

/// Every set of keys that may stand in the map.
std::vector<Keys> key_sets(const SchemaMap& map) {
  Keys common;
  for (const SchemaMap::Property& property : map.properties) {
    common.set(property.key, property_schema(property));
    if (is_required(property)) common.require(property.key);
  }
  std::vector<Keys> sets{common};
  for (const SchemaMap::Choice& choice : map.choices) {
    std::vector<Keys> chosen;
    for (const Keys& set : sets) {
      for (const SchemaMap::Alternative& alternative : choice.alternatives) {
        for (const Keys& added : key_sets(*alternative.map)) {
          Keys keys = set;
          Json name{{"const", alternative.name}};
          if (!alternative.doc.empty()) name["description"] = alternative.doc;
          const auto declared =
              std::find_if(set.properties.begin(), set.properties.end(),
                           [&](const auto& property) { return property.first == choice.key; });
          const bool is_default = declared->second.contains("default") &&
                                  declared->second["default"] == alternative.name;
          if (is_default) name["default"] = alternative.name;
          keys.set(choice.key, name);
          if (!is_default) keys.require(choice.key);
          add_note(keys.title, choice.key + ": " + alternative.name, ", ");
          add_note(keys.doc, alternative.doc, "; ");
          add_note(keys.title, added.title, ", ");
          add_note(keys.doc, added.doc, "; ");
          for (const auto& [key, schema] : added.properties) keys.set(key, schema);
          for (const std::string& key : added.required) keys.require(key);
          chosen.push_back(std::move(keys));
        }
      }
    }
    sets = std::move(chosen);
  }
  return sets;
}

Json keys_schema(const Keys& keys, bool may_be_empty) {
  Json schema = Json::object();
  if (!keys.title.empty()) schema["title"] = keys.title;
  if (!keys.doc.empty()) schema["description"] = keys.doc;
  schema["type"] = "object";
  // "scene:" without anything is a map of defaults.
  if (may_be_empty && keys.required.empty()) schema["type"] = {"object", "null"};
  schema["properties"] = Json::object();
  for (const auto& [key, value] : keys.properties) schema["properties"][key] = value;
  if (!keys.required.empty()) schema["required"] = keys.required;
  schema["additionalProperties"] = false;
  return schema;
}

Json map_schema(const SchemaMap& map, bool may_be_empty) {
  const std::vector<Keys> sets = key_sets(map);
  if (sets.size() == 1) return keys_schema(sets.front(), may_be_empty);
  Json alternatives = Json::array();
  for (const Keys& keys : sets) alternatives.push_back(keys_schema(keys, may_be_empty));
  return {{"oneOf", alternatives}};
}

}  // namespace

std::string boolean_schema() { return Json{{"type", "boolean"}}.dump(); }

std::string integer_schema(const Range& range) { return number_schema("integer", range).dump(); }

std::string real_schema(const Range& range) { return number_schema("number", range).dump(); }

std::string text_schema() { return Json{{"type", {"string", "number", "boolean"}}}.dump(); }

std::string names_schema(const std::vector<std::string>& names) {
  return Json{{"enum", names}}.dump();
}

std::string or_word_schema(const std::string& value, const std::string& word) {
  return Json{{"anyOf", {Json::parse(value), {{"const", word}}}}}.dump();
}

std::string list_schema(const std::string& entry, const Range& sizes, bool unique) {
  Json schema{{"type", "array"}, {"items", Json::parse(entry)}};
  add_sizes(schema, sizes);
  if (unique) schema["uniqueItems"] = true;
  return schema.dump();
}

std::string json_schema(const SchemaMap& root, const std::string& title,
                        const std::string& description) {
  Json schema{{"$schema", "https://json-schema.org/draft/2020-12/schema"},
              {"title", title},
              {"description", description}};
  const Json keys = map_schema(root, true);
  for (const auto& [key, value] : keys.items()) {
    if (!schema.contains(key)) schema[key] = value;
  }
  return schema.dump(2) + "\n";
}

}  // namespace uniphy
