#include "uniphy/config/config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "ops/kernels/base/error.hpp"
#include "uniphy/config/schema.hpp"
#include "uniphy/config/state.hpp"

namespace uniphy {
namespace {

/// Edits (insertions, deletions, substitutions, swaps of neighbours) from a to b.
int edit_distance(const std::string& a, const std::string& b) {
  const std::size_t n = a.size();
  const std::size_t m = b.size();
  std::vector<std::vector<int>> d(n + 1, std::vector<int>(m + 1));
  for (std::size_t i = 0; i <= n; ++i) d[i][0] = static_cast<int>(i);
  for (std::size_t j = 0; j <= m; ++j) d[0][j] = static_cast<int>(j);
  for (std::size_t i = 1; i <= n; ++i) {
    for (std::size_t j = 1; j <= m; ++j) {
      d[i][j] = std::min(
          {d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[n][m];
}

void refuse_unread(const Node& given, const Node& resolved, const std::vector<std::string>& absent,
                   const std::string& path) {
  for (const auto& [key, value] : given.entries) {
    const std::string full = path.empty() ? key : path + "." + key;
    const auto read = resolved.find(key);
    if (!read) {
      std::vector<std::string> known;
      for (const auto& entry : resolved.entries) known.push_back(entry.first);
      const std::string parent = path.empty() ? "" : path + ".";
      for (const std::string& other : absent) {
        const std::size_t dot = other.rfind('.');
        const std::size_t length = dot == std::string::npos ? 0 : dot + 1;
        if (other.substr(0, length) == parent) known.push_back(other.substr(length));
      }
      const std::string near = nearest_key(key, known);
      std::string hint = "no keys are known here";
      if (!near.empty()) {
        hint = fmt::format("did you mean \"{}\"?", near);
      } else if (!known.empty()) {
        hint = fmt::format("known keys here: {}", fmt::join(known, ", "));
      }
      throw Error(fmt::format("{}: {}: unknown key; {}", value->origin, full, hint));
    }
    refuse_unread(*value, *read, absent, full);
  }
  for (std::size_t i = 0; i < given.items.size() && i < resolved.items.size(); ++i) {
    refuse_unread(*given.items[i], *resolved.items[i], absent, fmt::format("{}.{}", path, i));
  }
}

/// An override without a value takes a key back. Where the document does not give the key, it is
/// one that a reader knows, or a slip.
void refuse_unknown(const std::vector<std::string>& taken_back, const Node& resolved,
                    const std::vector<std::string>& absent) {
  for (const std::string& assignment : taken_back) {
    const std::string path = assignment.substr(0, assignment.find('='));
    const bool known = std::any_of(absent.begin(), absent.end(), [&](const std::string& other) {
      return path == other || path.rfind(other + ".", 0) == 0;
    });
    if (known) continue;
    const Node* node = &resolved;
    for (std::size_t start = 0; node && start <= path.size();) {
      const std::size_t end = std::min(path.find('.', start), path.size());
      const std::string key = path.substr(start, end - start);
      if (node->kind == Node::Kind::list) {
        const auto index = parse_integer(key);
        const bool there = index && *index >= 0 && *index < std::int64_t(node->items.size());
        node = there ? node->items[std::size_t(*index)].get() : nullptr;
      } else {
        node = node->find(key).get();
      }
      start = end + 1;
    }
    if (!node) throw Error(fmt::format("--set {}: {}: unknown key", assignment, path));
  }
}

/// Words of `text` in lines of at most `width` columns.
std::vector<std::string> wrap(const std::string& text, std::size_t width) {
  std::vector<std::string> lines(1);
  for (std::size_t start = 0; start < text.size();) {
    const std::size_t end = std::min(text.find(' ', start), text.size());
    const std::string word = text.substr(start, end - start);
    if (!lines.back().empty() && lines.back().size() + 1 + word.size() > width) lines.push_back("");
    lines.back() += (lines.back().empty() ? "" : " ") + word;
    start = end + 1;
  }
  return lines;
}

void apply_overrides(const std::vector<std::string>& overrides, Config::State& state) {
  for (const std::string& assignment : overrides) {
    if (!apply_override(*state.given, assignment)) state.taken_back.push_back(assignment);
  }
}

}  // namespace

std::string nearest_key(const std::string& key, const std::vector<std::string>& known) {
  std::string best;
  // A third of the letters may be wrong; long keys are cut so that this stays cheap.
  int best_distance = static_cast<int>(std::min<std::size_t>(key.size(), 64)) / 3 + 1;
  if (key.size() > 64) return best;
  for (const std::string& candidate : known) {
    const int distance = edit_distance(key, candidate);
    if (distance >= static_cast<int>(key.size())) continue;  // nothing in common
    if (distance < best_distance || (distance == best_distance && best.empty())) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

std::string with_article(const std::string& noun) {
  const bool vowel = !noun.empty() && std::string("aeiou").find(noun[0]) != std::string::npos;
  if (noun.rfind("one of", 0) == 0 || noun.rfind("true", 0) == 0) return noun;
  return (vowel ? "an " : "a ") + noun;
}

Config::Config(std::shared_ptr<State> state) : state_(std::move(state)) {
  state_->resolved->kind = Node::Kind::map;
}

Config Config::load(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  auto state = std::make_shared<State>();
  state->given = load_document(file);
  apply_overrides(overrides, *state);
  return Config(state);
}

Config Config::parse(const std::string& text, const std::string& name,
                     const std::vector<std::string>& overrides) {
  auto state = std::make_shared<State>();
  state->given = parse_document(text, name);
  apply_overrides(overrides, *state);
  return Config(state);
}

Config Config::describe() {
  auto state = std::make_shared<State>();
  state->describing = true;
  state->schema = std::make_shared<SchemaMap>();
  state->given = std::make_shared<Node>();
  state->given->kind = Node::Kind::map;
  state->given->origin = "(describing)";
  return Config(state);
}

Section Config::root() const {
  return Section(state_, state_->given, state_->resolved, "", state_->schema);
}

bool Config::describing() const { return state_->describing; }

void Config::finish() const {
  if (state_->describing) return;
  refuse_unread(*state_->given, *state_->resolved, state_->absent, "");
  refuse_unknown(state_->taken_back, *state_->resolved, state_->absent);
}

std::string Config::resolved() const { return emit_document(*state_->resolved); }

const std::vector<KeyInfo>& Config::keys() const { return state_->keys; }

std::string Config::schema(const std::string& title, const std::string& description) const {
  return json_schema(state_->schema ? *state_->schema : SchemaMap(), title, description);
}

std::string Config::table(int width) const {
  std::size_t path_width = 0;
  for (const KeyInfo& key : state_->keys) path_width = std::max(path_width, key.path.size());
  path_width = std::min<std::size_t>(path_width, 34);
  const std::size_t indent = path_width + 4;
  const std::size_t rest =
      std::max<std::size_t>(static_cast<std::size_t>(width), indent + 30) - indent;
  std::string out;
  for (const KeyInfo& key : state_->keys) {
    std::string what = key.type;
    if (!key.unit.empty()) what += fmt::format(" ({})", key.unit);
    if (key.fallback == "required") {
      what += ", required";
    } else if (!key.fallback.empty()) {
      what += ", default " + key.fallback;
    }
    if (!key.when.empty()) what += fmt::format(", with {}", key.when);
    std::vector<std::string> lines = wrap(what, rest);
    for (std::string& line : wrap(key.doc, rest)) lines.push_back(std::move(line));
    out += fmt::format("  {:<{}}  {}\n", key.path, path_width,
                       key.path.size() > path_width ? "" : lines[0]);
    for (std::size_t i = key.path.size() > path_width ? 0 : 1; i < lines.size(); ++i) {
      out += fmt::format("{:{}}{}\n", "", indent, lines[i]);
    }
  }
  return out;
}

}  // namespace uniphy
