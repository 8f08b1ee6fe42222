#pragma once

// What --schema prints: the declarations of a configuration as a JSON Schema (draft 2020-12). While
// a Config describes, its readers collect the tree below, in which a variant keeps the keys of its
// alternatives apart; json_schema() writes it down. Private to uniphy/config.
//
// The schema takes what the readers take, except for what only they can tell: files that exist,
// low <= high, keys that exclude each other, and checks of the callers. Numbers are those of
// YAML 1.2 (5e-4 is one).

#include <memory>
#include <string>
#include <vector>

#include "uniphy/config/document.hpp"
#include "uniphy/config/value.hpp"

namespace uniphy {

/// The keys of one map.
struct SchemaMap {
  enum class Form { value, section, optional_section, list };

  struct Property {
    std::string key;
    std::string value;  ///< JSON Schema of a value; empty for maps and lists of them
    std::string unit, doc;
    std::string fallback;  ///< YAML, "required", or empty
    Form form = Form::value;
    Range sizes = {};                          ///< of a list
    std::shared_ptr<SchemaMap> map = nullptr;  ///< of a section, or of every entry of a list
  };
  struct Alternative {
    std::string name, doc;
    std::shared_ptr<SchemaMap> map;  ///< the keys that it adds
  };
  /// The alternatives that the value of `key` chooses from; it is one of the properties, too.
  struct Choice {
    std::string key;
    std::vector<Alternative> alternatives;
  };

  std::vector<Property> properties;
  std::vector<Choice> choices;
};

/// Schemas of single values as JSON.
std::string boolean_schema();
std::string integer_schema(const Range& range);
std::string real_schema(const Range& range);
/// A plain value of any type: what is read as a text need not stand in quotes.
std::string text_schema();
std::string names_schema(const std::vector<std::string>& names);
std::string or_word_schema(const std::string& value, const std::string& word);
std::string list_schema(const std::string& entry, const Range& sizes, bool unique);

/// The whole document.
std::string json_schema(const SchemaMap& root, const std::string& title,
                        const std::string& description);

}  // namespace uniphy
