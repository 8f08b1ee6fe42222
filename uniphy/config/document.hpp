#pragma once

// The YAML text as a tree of our own: yaml-cpp reads the syntax, this file decides what a
// configuration may contain. Refused with file and line: duplicate keys, anchors and aliases, tags,
// several documents, text that is not UTF-8, tabs as indentation, more than kMaximumDepth levels,
// more than kMaximumNodes values, files above kMaximumBytes.

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace uniphy {

inline constexpr std::size_t kMaximumBytes = 1 << 20;
inline constexpr int kMaximumDepth = 32;
inline constexpr int kMaximumNodes = 100000;

/// One value of a document, with the place it came from.
struct Node {
  enum class Kind { null, scalar, list, map };

  Kind kind = Kind::null;
  std::string text;     ///< scalar only
  bool quoted = false;  ///< scalar written in quotes: a string whatever it looks like
  std::string origin;   ///< "scene.yaml:12" or "--set scene.grid=8"
  std::vector<std::shared_ptr<Node>> items;                            ///< list only
  std::vector<std::pair<std::string, std::shared_ptr<Node>>> entries;  ///< map only, in order

  /// The entry of a map, or null.
  std::shared_ptr<Node> find(const std::string& key) const;
  /// What a message calls this value: `"abc"`, `a list of 3`, `a map`, `nothing`.
  std::string found() const;
};

/// Parses one YAML document; `name` stands for the file in messages. An empty document is an empty
/// map. Throws Error.
std::shared_ptr<Node> parse_document(const std::string& text, const std::string& name);

/// Reads and parses a file. Throws Error that says what is wrong with the file.
std::shared_ptr<Node> load_document(const std::filesystem::path& file);

/// Applies one `key.path=value` (value in YAML syntax; numbers in the path index lists, the length
/// of the list appends) to the root map. Maps on the way are made. `key.path=null` or `key.path=`
/// takes a key, a whole map or an entry of a list out again, as if the document did not give it;
/// the entries after one move up. The result is false where there was nothing to take out. Throws
/// Error.
bool apply_override(Node& root, const std::string& assignment);

/// The document as YAML that parse_document reads back to the same tree.
std::string emit_document(const Node& root);

}  // namespace uniphy
