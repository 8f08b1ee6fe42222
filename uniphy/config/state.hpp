#pragma once

// Private to config.cpp, section.cpp and readers.cpp.

#include <memory>
#include <string>
#include <vector>

#include "uniphy/config/config.hpp"

namespace uniphy {

struct Config::State {
  std::shared_ptr<Node> given;
  std::shared_ptr<Node> resolved = std::make_shared<Node>();
  bool describing = false;
  std::vector<std::string> taken_back;  ///< overrides that found nothing to take back
  std::vector<std::string> absent;    ///< full paths of what may be given and is not in `resolved`
  std::vector<KeyInfo> keys;          ///< filled while describing
  std::shared_ptr<SchemaMap> schema;  ///< of the root, filled while describing
  std::vector<std::string> outer;     ///< enclosing variants of keys[i], without its innermost one
  std::vector<std::string> variants;  ///< the variants being read, outermost first
  std::vector<std::string> variant_names;  ///< their alternatives: "elastic" for "type: elastic"
};

/// The nearest of `known` to a misspelt `key`, or "" where none is near.
std::string nearest_key(const std::string& key, const std::vector<std::string>& known);

/// "an integer", "a number"
std::string with_article(const std::string& noun);

}  // namespace uniphy
