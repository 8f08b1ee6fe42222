#include "uniphy/config/document.hpp"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/mark.h>
#include <yaml-cpp/parser.h>

#include <cstddef>
#include <sstream>

#include "ops/kernels/base/error.hpp"
#include "uniphy/config/text_check.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

[[noreturn]] void fail_at(const std::string& origin, const std::string& message) {
  throw Error(fmt::format("{}: {}", origin, message));
}

/// Builds the tree from yaml-cpp's events. Limits are held while events come in, so that a hostile
/// document stops the parser instead of filling the memory.
class TreeBuilder : public YAML::EventHandler {
 public:
  TreeBuilder(std::string name, bool lines) : name_(std::move(name)), lines_(lines) {}

  std::shared_ptr<Node> root() const { return root_; }

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    fail_at(at(mark), "YAML aliases (*name) are not supported; write the value out");
  }
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    add(make(mark, Node::Kind::null, "", anchor));
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    if (expects_key()) {
      if (anchor != 0) refuse_anchor(mark);
      key_ = value;
      key_mark_ = mark;
      has_key_ = true;
      check_duplicate(mark);
      return;
    }
    auto node = make(mark, Node::Kind::scalar, tag, anchor);
    node->text = value;
    node->quoted = tag == "!";
    if (!node->quoted && (value == "~" || value == "null" || value == "Null" || value == "NULL")) {
      node->kind = Node::Kind::null;
      node->text.clear();
    }
    add(node);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(make(mark, Node::Kind::list, tag, anchor), mark);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(make(mark, Node::Kind::map, tag, anchor), mark);
  }
  void OnMapEnd() override { close(); }

 private:
  std::string at(const YAML::Mark& mark) const {
    return lines_ ? fmt::format("{}:{}", name_, mark.line + 1) : name_;
  }
  bool expects_key() const {
    return !levels_.empty() && levels_.back()->kind == Node::Kind::map && !has_key_;
  }
  [[noreturn]] void refuse_anchor(const YAML::Mark& mark) const {
    fail_at(at(mark), "YAML anchors (&name) are not supported; write the value out");
  }
  void check_duplicate(const YAML::Mark& mark) const {
    if (const auto first = levels_.back()->find(key_)) {
      fail_at(at(mark),
              fmt::format("key \"{}\" is given twice (first at {})", key_, first->origin));
    }
  }
  std::shared_ptr<Node> make(const YAML::Mark& mark, Node::Kind kind, const std::string& tag,
                             YAML::anchor_t anchor) {
    if (anchor != 0) refuse_anchor(mark);
    // "?" and "!" are yaml-cpp's marks of plain and quoted values without a tag.
    if (!tag.empty() && tag != "?" && tag != "!") {
      fail_at(at(mark), fmt::format("YAML tags are not supported, found \"{}\"", tag));
    }
    if (expects_key())
      fail_at(at(mark), "expected a plain key, found a list or a map; is a bracket left open?");
    if (++count_ > kMaximumNodes) {
      fail_at(at(mark), fmt::format("expected at most {} values", kMaximumNodes));
    }
    auto node = std::make_shared<Node>();
    node->kind = kind;
    node->origin = at(has_key_ ? key_mark_ : mark);
    return node;
  }
  void add(const std::shared_ptr<Node>& node) {
    if (levels_.empty()) {
      root_ = node;
    } else if (levels_.back()->kind == Node::Kind::list) {
      levels_.back()->items.push_back(node);
    } else {
      levels_.back()->entries.emplace_back(key_, node);
      has_key_ = false;
    }
  }
  void open(const std::shared_ptr<Node>& node, const YAML::Mark& mark) {
    if (static_cast<int>(levels_.size()) >= kMaximumDepth) {
      fail_at(at(mark), fmt::format("expected at most {} nested levels", kMaximumDepth));
    }
    add(node);
    levels_.push_back(node);
    has_key_ = false;
  }
  void close() { levels_.pop_back(); }

  std::string name_;
  bool lines_;
  std::shared_ptr<Node> root_;
  std::vector<std::shared_ptr<Node>> levels_;
  std::string key_;
  YAML::Mark key_mark_;
  bool has_key_ = false;
  int count_ = 0;
};

std::shared_ptr<Node> parse_yaml(const std::string& text, const std::string& name, bool lines) {
  std::istringstream stream(text);
  TreeBuilder builder(name, lines);
  try {
    YAML::Parser parser(stream);
    if (!parser.HandleNextDocument(builder)) return nullptr;
    TreeBuilder second(name, lines);
    if (parser.HandleNextDocument(second)) fail_at(name, "expected one YAML document, found two");
  } catch (const YAML::Exception& error) {
    const std::string where =
        lines && error.mark.line >= 0 ? fmt::format("{}:{}", name, error.mark.line + 1) : name;
    fail_at(where, fmt::format("not valid YAML: {}", error.msg));
  }
  return builder.root();
}

/// The index that a part of a path names in a list; its length, to append, unless an entry must
/// `exist`. `fail` gets what was expected otherwise.
template <class Fail>
std::size_t index_of(const Node& list, const std::string& key, bool exist, const Fail& fail) {
  const std::size_t end = list.items.size() + (exist ? 0 : 1);
  if (end == 0) fail("expected a list with entries, found an empty one");
  std::size_t index = 0;
  for (const char c : key) {
    if (c < '0' || c > '9' || index >= end) {
      index = end;
      break;
    }
    index = index * 10 + static_cast<std::size_t>(c - '0');
  }
  if (index >= end) {
    fail(fmt::format("expected an index from 0 to {} of a list, found \"{}\"", end - 1, key));
  }
  return index;
}

}  // namespace

std::shared_ptr<Node> Node::find(const std::string& key) const {
  for (const auto& entry : entries) {
    if (entry.first == key) return entry.second;
  }
  return nullptr;
}

std::string Node::found() const {
  switch (kind) {
    case Kind::null:
      return "nothing";
    case Kind::list:
      return fmt::format("a list of {}", items.size());
    case Kind::map:
      return "a map";
    case Kind::scalar:
      break;
  }
  const std::string shown = text.size() > 60 ? text.substr(0, 57) + "..." : text;
  return fmt::format("{}\"{}\"", quoted ? "the quoted text " : "", shown);
}

std::shared_ptr<Node> parse_document(const std::string& text, const std::string& name) {
  check_text(text, name);
  auto root = parse_yaml(text, name, true);
  if (!root || root->kind == Node::Kind::null) {
    root = std::make_shared<Node>();
    root->kind = Node::Kind::map;
    root->origin = name;
  }
  if (root->kind != Node::Kind::map) {
    fail_at(root->origin, fmt::format("expected a map of keys, found {}", root->found()));
  }
  return root;
}

std::shared_ptr<Node> load_document(const std::filesystem::path& file) {
  return parse_document(read_text_file(file, kMaximumBytes), file.string());
}

bool apply_override(Node& root, const std::string& assignment) {
  const std::string origin = "--set " + assignment;
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0) {
    fail_at(origin, "expected key.path=value");
  }
  check_text(assignment, origin);
  const std::string path = assignment.substr(0, equals);
  auto value = parse_yaml(assignment.substr(equals + 1), origin, false);
  if (!value) {
    value = std::make_shared<Node>();
    value->origin = origin;
  }
  const bool takes_back = value->kind == Node::Kind::null;

  Node* node = &root;
  std::size_t start = 0;
  int depth = 0;
  while (true) {
    const std::size_t dot = path.find('.', start);
    const std::string key = path.substr(start, dot == std::string::npos ? dot : dot - start);
    const bool last = dot == std::string::npos;
    if (key.empty()) fail_at(origin, "expected key.path=value, found an empty key in the path");
    if (++depth > kMaximumDepth) {
      fail_at(origin, fmt::format("expected at most {} nested levels", kMaximumDepth));
    }
    std::shared_ptr<Node>* slot = nullptr;
    std::size_t at = 0;  // of the slot in its map or list
    if (node->kind == Node::Kind::null) {
      if (takes_back) return false;
      node->kind = Node::Kind::map;
    }
    if (node->kind == Node::Kind::list) {
      at = index_of(*node, key, takes_back, [&](const std::string& expected) {
        fail_at(origin, path.substr(0, start ? start - 1 : 0) + ": " + expected);
      });
      if (at == node->items.size()) node->items.emplace_back();
      slot = &node->items[at];
    } else if (node->kind == Node::Kind::map) {
      while (at < node->entries.size() && node->entries[at].first != key) ++at;
      if (at == node->entries.size()) {
        if (takes_back) return false;
        node->entries.emplace_back(key, nullptr);
      }
      slot = &node->entries[at].second;
    } else {
      fail_at(origin, fmt::format("{}: expected a map or a list, found {}",
                                  path.substr(0, start - 1), node->found()));
    }
    if (last && takes_back) {
      const auto offset = static_cast<std::ptrdiff_t>(at);
      if (node->kind == Node::Kind::list) {
        node->items.erase(node->items.begin() + offset);
      } else {
        node->entries.erase(node->entries.begin() + offset);
      }
      return true;
    }
    if (last) {
      *slot = value;
      return true;
    }
    if (!*slot) {
      *slot = std::make_shared<Node>();
      (*slot)->kind = Node::Kind::map;
      (*slot)->origin = origin;
    }
    node = slot->get();
    start = dot + 1;
  }
}

}  // namespace uniphy
