// Sections, lists, variants, and the record of what was declared. The readers of values are in
// readers.cpp.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>

#include "ops/kernels/base/error.hpp"
#include "uniphy/config/config.hpp"
#include "uniphy/config/schema.hpp"
#include "uniphy/config/state.hpp"

namespace uniphy {
namespace {

std::shared_ptr<Node> empty_map(const std::string& origin) {
  auto node = std::make_shared<Node>();
  node->kind = Node::Kind::map;
  node->origin = origin;
  return node;
}

}  // namespace

Section::Section(std::shared_ptr<Config::State> state, std::shared_ptr<Node> given,
                 std::shared_ptr<Node> resolved, std::string path,
                 std::shared_ptr<SchemaMap> schema)
    : state_(std::move(state)),
      given_(std::move(given)),
      resolved_(std::move(resolved)),
      path_(std::move(path)),
      schema_(std::move(schema)) {}

bool Section::describing() const { return state_->describing; }

bool Section::has(const std::string& key) const { return given_->find(key) != nullptr; }

std::string Section::full_path(const std::string& key) const {
  return path_.empty() ? key : path_ + "." + key;
}

void Section::fail(const std::string& key, const std::string& message) const {
  const auto node = given_->find(key);
  throw Error(
      fmt::format("{}: {}: {}", node ? node->origin : given_->origin, full_path(key), message));
}

std::shared_ptr<Node> Section::declare(const std::string& key, const Kind& kind,
                                       const std::string& fallback, const std::string& doc) {
  auto node = std::make_shared<Node>();
  if (!state_->describing) {
    if (resolved_->find(key)) {
      throw std::logic_error(fmt::format("key \"{}\" is declared twice", full_path(key)));
    }
    resolved_->entries.emplace_back(key, node);
    return node;
  }
  schema_->properties.push_back({key, kind.schema, kind.unit, doc, fallback});
  const KeyInfo row{
      full_path(key), kind.text(), kind.unit,
      fallback,       doc,         fmt::format("{}", fmt::join(state_->variants, ", "))};
  std::string outer;
  for (std::size_t i = 0; i + 1 < state_->variants.size(); ++i) outer += state_->variants[i] + ", ";
  for (std::size_t i = 0; i < state_->keys.size(); ++i) {
    KeyInfo& other = state_->keys[i];
    if (other.path != row.path) continue;
    if (other.when == row.when) {
      throw std::logic_error(fmt::format("key \"{}\" is declared twice", row.path));
    }
    // The same key of several alternatives is one row: "type: elastic | sand".
    if (!row.when.empty() && state_->outer[i] == outer && other.type == row.type &&
        other.unit == row.unit && other.fallback == row.fallback && other.doc == row.doc) {
      other.when += " | " + state_->variant_names.back();
      return node;
    }
  }
  state_->keys.push_back(row);
  state_->outer.push_back(outer);
  return node;
}

void Section::refuse(const std::string& key, const Node& node, const Kind& kind) const {
  const std::string unit = kind.unit.empty() ? "" : fmt::format(" ({})", kind.unit);
  throw Error(fmt::format("{}: {}: expected {}{}, found {}", node.origin, full_path(key),
                          with_article(kind.text()), unit, node.found()));
}

void Section::missing(const std::string& key, const Kind& kind) const {
  const std::string unit = kind.unit.empty() ? "" : fmt::format(" ({})", kind.unit);
  // The likely cause is a misspelt key, which finish() would come too late to report.
  std::vector<std::string> unread;
  for (const auto& entry : given_->entries) {
    if (!resolved_->find(entry.first)) unread.push_back(entry.first);
  }
  const std::string near = nearest_key(key, unread);
  const std::string hint =
      near.empty() ? "" : fmt::format("; found \"{}\" ({})", near, given_->find(near)->origin);
  throw Error(fmt::format("{}: {}: required key is missing, expected {}{}{}", given_->origin,
                          full_path(key), with_article(kind.text()), unit, hint));
}

std::shared_ptr<SchemaMap> Section::add_map(bool optional) {
  if (!schema_) return nullptr;
  SchemaMap::Property& property = schema_->properties.back();
  property.form = optional ? SchemaMap::Form::optional_section : SchemaMap::Form::section;
  property.map = std::make_shared<SchemaMap>();
  return property.map;
}

Section Section::section(const std::string& key, const std::string& doc) {
  const Kind kind{"map", "", ""};
  auto resolved = declare(key, kind, "", doc);
  resolved->kind = Node::Kind::map;
  auto given = given_->find(key);
  if (!given || given->kind == Node::Kind::null) {
    given = empty_map(given ? given->origin : given_->origin);
  } else if (given->kind != Node::Kind::map) {
    refuse(key, *given, kind);
  }
  return Section(state_, given, resolved, full_path(key), add_map(false));
}

std::optional<Section> Section::optional_section(const std::string& key, const std::string& doc) {
  const auto said = given_->find(key);
  const bool none = said && said->kind == Node::Kind::scalar && said->text == "none";
  if (none) {
    const auto is_it = [&](const auto& entry) { return entry.first == key; };
    given_->entries.erase(std::find_if(given_->entries.begin(), given_->entries.end(), is_it));
  }
  if (!state_->describing && !has(key)) {
    // Remembered, so that a misspelt key finds its neighbour.
    state_->absent.push_back(full_path(key));
    return std::nullopt;
  }
  const Kind kind{"map", ", optional", ""};
  auto resolved = declare(key, kind, "", doc);
  resolved->kind = Node::Kind::map;
  auto given = given_->find(key);
  if (!given) {
    given = empty_map(given_->origin);
  } else if (given->kind == Node::Kind::null) {
    given = empty_map(given->origin);
  } else if (given->kind != Node::Kind::map) {
    refuse(key, *given, kind);
  }
  return Section(state_, given, resolved, full_path(key), add_map(true));
}

std::vector<Section> Section::list(const std::string& key, const std::string& doc,
                                   const Range& sizes) {
  Kind kind{"list of maps", "", ""};
  if (sizes.low > 0) kind.suffix = fmt::format(", at least {:g}", sizes.low);
  const bool may_be_absent = sizes.contains(0);
  auto resolved = declare(key, kind, may_be_absent ? "[]" : "required", doc);
  resolved->kind = Node::Kind::list;
  std::vector<Section> sections;
  if (state_->describing) {
    const auto entry = add_map(false);
    schema_->properties.back().form = SchemaMap::Form::list;
    schema_->properties.back().sizes = sizes;
    sections.push_back(
        Section(state_, empty_map(given_->origin), empty_map(""), full_path(key) + "[]", entry));
    return sections;
  }
  const auto given = given_->find(key);
  if (!given) {
    if (!may_be_absent) missing(key, kind);
    return sections;
  }
  if (given->kind != Node::Kind::list ||
      !sizes.contains(static_cast<double>(given->items.size()))) {
    refuse(key, *given, kind);
  }
  for (std::size_t i = 0; i < given->items.size(); ++i) {
    const Node& item = *given->items[i];
    const std::string path = fmt::format("{}.{}", full_path(key), i);
    if (item.kind != Node::Kind::map) {
      throw Error(fmt::format("{}: {}: expected a map, found {}", item.origin, path, item.found()));
    }
    resolved->items.push_back(empty_map(item.origin));
    sections.push_back(Section(state_, given->items[i], resolved->items.back(), path));
  }
  return sections;
}

std::string Section::variant(const std::string& key, Default<std::string> fallback,
                             const std::vector<Variant>& alternatives, const std::string& doc) {
  std::vector<std::string> names;
  std::string docs = doc;
  for (const Variant& alternative : alternatives) {
    names.push_back(alternative.name);
    if (!alternative.doc.empty())
      docs += fmt::format("; {}: {}", alternative.name, alternative.doc);
  }
  const std::string chosen = choice(key, std::move(fallback), names, docs);
  const auto keys = schema_;
  const std::size_t place = keys ? keys->choices.size() : 0;
  if (keys) keys->choices.push_back({key, {}});
  for (const Variant& alternative : alternatives) {
    if (!state_->describing && alternative.name != chosen) continue;
    state_->variants.push_back(fmt::format("{}: {}", key, alternative.name));
    state_->variant_names.push_back(alternative.name);
    if (keys) {
      schema_ = std::make_shared<SchemaMap>();
      keys->choices[place].alternatives.push_back({alternative.name, alternative.doc, schema_});
    }
    if (alternative.read) alternative.read(*this);
    schema_ = keys;
    state_->variants.pop_back();
    state_->variant_names.pop_back();
  }
  return chosen;
}

}  // namespace uniphy
