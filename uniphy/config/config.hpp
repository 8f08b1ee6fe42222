#pragma once

// Configuration where every key is declared in the one place that reads it: the reader gives its
// type, unit, default, range and one line of documentation. The same code runs on a document (then
// it checks and returns values) and on no document at all (then it collects the table that --help
// prints and the JSON Schema that --schema prints).
//
//   Config config = Config::load("scene.yaml", {"scene.grid=32"});
//   Section root = config.root();
//   Section scene = root.section("scene", "the grid and the walls");
//   std::int64_t grid = scene.integer("grid", 20, between(8, 1024), "", "nodes a side");
//   double density = scene.real("density", required, positive(), "kg/m^3", "mass density");
//   config.finish();  // refuses keys that nobody read
//
// Messages: `scene.yaml:12: scene.grid: expected an integer in [8, 1024], found "abc"`.

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "uniphy/config/document.hpp"
#include "uniphy/config/value.hpp"

namespace uniphy {

/// One row of the table of keys.
struct KeyInfo {
  std::string path;      ///< "bodies[].law.mu"
  std::string type;      ///< "number > 0"
  std::string unit;      ///< "Pa", or empty
  std::string fallback;  ///< YAML of the default, or "required"
  std::string doc;
  std::string when;  ///< "type: elastic" inside a variant, or empty
};

class Section;
struct SchemaMap;  // schema.hpp

/// One alternative of Section::variant.
struct Variant {
  std::string name;
  std::string doc;
  std::function<void(Section&)> read;  ///< declares and reads this alternative's keys
};

class Config {
 public:
  /// Throws Error for an unreadable or malformed file and for a malformed override.
  static Config load(const std::filesystem::path& file,
                     const std::vector<std::string>& overrides = {});
  static Config parse(const std::string& text, const std::string& name = "config",
                      const std::vector<std::string>& overrides = {});
  /// No document: readers return defaults (or harmless values of the right type where a key is
  /// required, one entry where a list is asked for, every alternative of a variant in turn).
  static Config describe();

  Section root() const;
  bool describing() const;
  /// Throws Error naming the first key of the document that no reader declared, with the nearest
  /// declared key.
  void finish() const;
  /// Everything that was read, defaults filled in, as YAML; reading it back gives the same values.
  std::string resolved() const;
  /// Every declared key, in the order of the readers.
  const std::vector<KeyInfo>& keys() const;
  /// The keys as text of at most `width` columns.
  std::string table(int width = 100) const;
  /// The keys as a JSON Schema (draft 2020-12), by which editors complete and check YAML. Of
  /// describe() only.
  std::string schema(const std::string& title, const std::string& description) const;

  struct State;

 private:
  explicit Config(std::shared_ptr<State> state);
  std::shared_ptr<State> state_;
};

/// A map of the document. Copies refer to the same place. Every reader throws Error for a missing
/// required key, a wrong type, a value out of range or not finite; reading a key twice is a
/// std::logic_error, for a key has one declaration.
class Section {
 public:
  bool boolean(const std::string& key, Default<bool> fallback, const std::string& doc);
  std::int64_t integer(const std::string& key, Default<std::int64_t> fallback, const Range& range,
                       const std::string& unit, const std::string& doc);
  double real(const std::string& key, Default<double> fallback, const Range& range,
              const std::string& unit, const std::string& doc);
  std::string text(const std::string& key, Default<std::string> fallback, const std::string& doc);
  /// One of `names`.
  std::string choice(const std::string& key, Default<std::string> fallback,
                     const std::vector<std::string>& names, const std::string& doc);
  /// A path as written (relative to the working directory) of a file that must exist; an empty
  /// default means none and is not checked, and "none" is read as it.
  std::filesystem::path input_file(const std::string& key, Default<std::string> fallback,
                                   const std::string& doc);

  /// The same of a file or a directory.
  std::filesystem::path input_path(const std::string& key, Default<std::string> fallback,
                                   const std::string& doc);

  /// A number, or `word` ("auto", "none"), which reads as nullopt. A nullopt default is the word.
  std::optional<double> real_or(const std::string& word, const std::string& key,
                                Default<std::optional<double>> fallback, const Range& range,
                                const std::string& unit, const std::string& doc);

  std::array<double, 3> vector3(const std::string& key, Default<std::array<double, 3>> fallback,
                                const Range& range, const std::string& unit,
                                const std::string& doc);
  /// [low, high] with low <= high, both in `range`.
  std::array<double, 2> interval(const std::string& key, Default<std::array<double, 2>> fallback,
                                 const Range& range, const std::string& unit,
                                 const std::string& doc);
  /// `sizes` is the range of the number of entries.
  std::vector<double> reals(const std::string& key, Default<std::vector<double>> fallback,
                            const Range& range, const std::string& unit, const std::string& doc,
                            const Range& sizes = {});
  std::vector<std::int64_t> integers(const std::string& key,
                                     Default<std::vector<std::int64_t>> fallback,
                                     const Range& range, const std::string& unit,
                                     const std::string& doc, const Range& sizes = {});
  std::vector<std::string> texts(const std::string& key, Default<std::vector<std::string>> fallback,
                                 const std::string& doc, const Range& sizes = {});
  /// Entries from `names`, no name twice.
  std::vector<std::string> choices(const std::string& key,
                                   Default<std::vector<std::string>> fallback,
                                   const std::vector<std::string>& names, const std::string& doc,
                                   const Range& sizes = {});

  /// For two keys that have been read and exclude each other: throws Error where both are given,
  /// and leaves the one that does not count (`key`, where neither is given) out of resolved().
  void one_of(const std::string& key, const std::string& other);
  /// For keys that have been read and do not count beside another one: throws Error where one of
  /// them is given, and leaves them out of resolved().
  void none_of(const std::vector<std::string>& keys, const std::string& beside);

  /// A nested map; where it is absent all its keys take their defaults.
  Section section(const std::string& key, const std::string& doc);
  /// A nested map, or nullopt where it is absent. Always present while describing.
  std::optional<Section> optional_section(const std::string& key, const std::string& doc);
  /// A list of maps. While describing, one entry whose path ends in "[]".
  std::vector<Section> list(const std::string& key, const std::string& doc,
                            const Range& sizes = {});

  /// Reads `key` as the name of one of the alternatives and then that alternative's keys, which
  /// stand beside `key` in this map. While describing all alternatives run. Returns the name.
  std::string variant(const std::string& key, Default<std::string> fallback,
                      const std::vector<Variant>& alternatives, const std::string& doc);

  bool describing() const;
  /// Whether the document gives this key (always false while describing).
  bool has(const std::string& key) const;
  /// Whether the document gives this key with this plain text.
  bool says(const std::string& key, const std::string& text) const;
  /// "bodies.0.law", empty for the root.
  const std::string& path() const { return path_; }
  /// The error of a value that only the caller can judge: `file:line: path.key: message`.
  [[noreturn]] void fail(const std::string& key, const std::string& message) const;

 private:
  friend class Config;
  Section(std::shared_ptr<Config::State> state, std::shared_ptr<Node> given,
          std::shared_ptr<Node> resolved, std::string path,
          std::shared_ptr<SchemaMap> schema = nullptr);

  /// How a value is described in the table and in messages: noun "number", suffix " > 0".
  struct Kind {
    std::string noun;
    std::string suffix;
    std::string unit;
    std::string schema = "";  ///< JSON Schema of the value; empty for maps and lists of them
    std::string text() const { return noun + suffix; }
  };

  std::string full_path(const std::string& key) const;
  /// Takes a key that was read and is not given out of resolved().
  void forget(const std::string& key);
  /// `kind`: what is expected there.
  std::filesystem::path existing_path(const std::string& key, const Default<std::string>& fallback,
                                      const std::string& kind, const std::string& doc);
  /// Records one declaration; returns the resolved node to fill in.
  std::shared_ptr<Node> declare(const std::string& key, const Kind& kind,
                                const std::string& fallback, const std::string& doc);
  /// The map that was declared last, in the schema while describing: its keys.
  std::shared_ptr<SchemaMap> add_map(bool optional);
  [[noreturn]] void refuse(const std::string& key, const Node& node, const Kind& kind) const;
  [[noreturn]] void missing(const std::string& key, const Kind& kind) const;
  /// parse: Node → optional<T>; show: T → YAML text; dummy: what a required key reads as while
  /// describing.
  template <class T, class Parse, class Show>
  T scalar(const std::string& key, const Default<T>& fallback, const Kind& kind,
           const std::string& doc, const T& dummy, Parse parse, Show show);
  template <class T, class Parse, class Show>
  std::vector<T> sequence(const std::string& key, const Default<std::vector<T>>& fallback,
                          const Kind& kind, const std::string& doc, const Range& sizes,
                          const T& dummy, Parse parse, Show show, bool unique = false);
  std::vector<double> reals_of(const std::string& key, const Default<std::vector<double>>& fallback,
                               const Range& range, const std::string& unit, const std::string& doc,
                               const Range& sizes);

  std::shared_ptr<Config::State> state_;
  std::shared_ptr<Node> given_;     ///< what the document says here
  std::shared_ptr<Node> resolved_;  ///< what was read here, defaults filled in
  std::string path_;
  std::shared_ptr<SchemaMap> schema_;  ///< while describing: the keys of this map
};

}  // namespace uniphy
