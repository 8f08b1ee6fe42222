// The readers of single values and of lists of values.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "ops/kernels/base/error.hpp"
#include "uniphy/config/config.hpp"
#include "uniphy/config/schema.hpp"
#include "uniphy/config/state.hpp"

namespace uniphy {
namespace {

Node scalar_node(const std::string& text, bool quoted) {
  Node node;
  node.kind = Node::Kind::scalar;
  node.text = text;
  node.quoted = quoted;
  return node;
}

/// A number inside the range, for required keys while describing.
double some_number(const Range& range) {
  const bool low = std::isfinite(range.low);
  const bool high = std::isfinite(range.high);
  if (low && high) return range.low_open ? 0.5 * (range.low + range.high) : range.low;
  if (low) return range.low_open ? range.low + 1 : range.low;
  return high ? range.high - 1 : 1;
}

std::optional<double> real_in(const Node& node, const Range& range) {
  if (node.kind != Node::Kind::scalar || node.quoted) return {};
  const auto value = parse_real(node.text);
  return value && range.contains(*value) ? value : std::nullopt;
}

std::optional<std::int64_t> integer_in(const Node& node, const Range& range) {
  if (node.kind != Node::Kind::scalar || node.quoted) return {};
  const auto value = parse_integer(node.text);
  return value && range.contains(static_cast<double>(*value)) ? value : std::nullopt;
}

std::optional<std::string> text_in(const Node& node) {
  return node.kind == Node::Kind::scalar ? std::optional(node.text) : std::nullopt;
}

std::optional<std::string> name_in(const Node& node, const std::vector<std::string>& names) {
  if (node.kind != Node::Kind::scalar) return {};
  const bool known = std::find(names.begin(), names.end(), node.text) != names.end();
  return known ? std::optional(node.text) : std::nullopt;
}

std::string real_noun(const Range& range) { return range.infinite ? "number" : "finite number"; }

const auto same_text = [](const std::string& value) { return scalar_node(value, true); };
const auto plain_real = [](double value) { return scalar_node(format_real(value), false); };
const auto plain_integer = [](std::int64_t value) {
  return scalar_node(std::to_string(value), false);
};

/// YAML of one value, for the table of keys.
std::string yaml_text(const Node& node) {
  Node list;
  list.kind = Node::Kind::list;
  list.items.push_back(std::make_shared<Node>(node));
  Node root;
  root.kind = Node::Kind::map;
  root.entries.emplace_back("k", std::make_shared<Node>(list));
  const std::string text = emit_document(root);  // "k: [value]\n"
  return text.substr(4, text.size() - 6);
}

}  // namespace

template <class T, class Parse, class Show>
T Section::scalar(const std::string& key, const Default<T>& fallback, const Kind& kind,
                  const std::string& doc, const T& dummy, Parse parse, Show show) {
  if (fallback.value && !parse(show(*fallback.value))) {
    throw std::logic_error(
        fmt::format("the default of \"{}\" is not {}", full_path(key), with_article(kind.text())));
  }
  const std::string shown = fallback.value ? yaml_text(show(*fallback.value)) : "required";
  const auto given = given_->find(key);
  if (!given && !fallback.value && !state_->describing) missing(key, kind);
  auto resolved = declare(key, kind, shown, doc);
  T value = fallback.value.value_or(dummy);
  if (given) {
    const auto parsed = parse(*given);
    if (!parsed) refuse(key, *given, kind);
    value = *parsed;
  }
  *resolved = show(value);
  return value;
}

template <class T, class Parse, class Show>
std::vector<T> Section::sequence(const std::string& key, const Default<std::vector<T>>& fallback,
                                 const Kind& element, const std::string& doc, const Range& sizes,
                                 const T& dummy, Parse parse, Show show, bool unique) {
  std::string count;
  if (sizes.low == sizes.high) {
    count = fmt::format("{:g} ", sizes.low);
  } else if (sizes.low > 0 && std::isfinite(sizes.high)) {
    count = fmt::format("{:g} to {:g} ", sizes.low, sizes.high);
  } else if (sizes.low > 0) {
    count = fmt::format("at least {:g} ", sizes.low);
  } else if (std::isfinite(sizes.high)) {
    count = fmt::format("at most {:g} ", sizes.high);
  }
  const Kind kind{fmt::format("list of {}{}s", count, element.noun), element.suffix, element.unit,
                  list_schema(element.schema, sizes, unique)};
  std::string shown = "required";
  if (fallback.value) {
    std::vector<std::string> parts;
    for (const T& value : *fallback.value) {
      if (!parse(show(value))) {
        throw std::logic_error(fmt::format("a default of \"{}\" is not {}", full_path(key),
                                           with_article(element.text())));
      }
      parts.push_back(yaml_text(show(value)));
    }
    shown = fmt::format("[{}]", fmt::join(parts, ", "));
  }
  const auto given = given_->find(key);
  if (!given && !fallback.value && !state_->describing) missing(key, kind);
  auto resolved = declare(key, kind, shown, doc);
  std::vector<T> values;
  if (given) {
    if (given->kind != Node::Kind::list ||
        !sizes.contains(static_cast<double>(given->items.size()))) {
      refuse(key, *given, kind);
    }
    for (std::size_t i = 0; i < given->items.size(); ++i) {
      const auto parsed = parse(*given->items[i]);
      if (!parsed) refuse(fmt::format("{}.{}", key, i), *given->items[i], element);
      values.push_back(*parsed);
    }
  } else if (fallback.value) {
    values = *fallback.value;
  } else {
    values.assign(static_cast<std::size_t>(std::max(1.0, sizes.low)), dummy);
  }
  resolved->kind = Node::Kind::list;
  for (const T& value : values) resolved->items.push_back(std::make_shared<Node>(show(value)));
  return values;
}

bool Section::boolean(const std::string& key, Default<bool> fallback, const std::string& doc) {
  const auto parse = [](const Node& node) -> std::optional<bool> {
    if (node.kind != Node::Kind::scalar || node.quoted) return {};
    return parse_boolean(node.text);
  };
  return scalar<bool>(key, fallback, {"true or false", "", "", boolean_schema()}, doc, false, parse,
                      [](bool value) { return scalar_node(value ? "true" : "false", false); });
}

std::int64_t Section::integer(const std::string& key, Default<std::int64_t> fallback,
                              const Range& range, const std::string& unit, const std::string& doc) {
  return scalar<std::int64_t>(
      key, fallback, {"integer", range.text(), unit, integer_schema(range)}, doc,
      static_cast<std::int64_t>(std::ceil(some_number(range))),
      [&](const Node& node) { return integer_in(node, range); }, plain_integer);
}

double Section::real(const std::string& key, Default<double> fallback, const Range& range,
                     const std::string& unit, const std::string& doc) {
  return scalar<double>(
      key, fallback, {real_noun(range), range.text(), unit, real_schema(range)}, doc,
      some_number(range), [&](const Node& node) { return real_in(node, range); }, plain_real);
}

std::string Section::text(const std::string& key, Default<std::string> fallback,
                          const std::string& doc) {
  return scalar<std::string>(key, fallback, {"text", "", "", text_schema()}, doc, "text", text_in,
                             same_text);
}

std::string Section::choice(const std::string& key, Default<std::string> fallback,
                            const std::vector<std::string>& names, const std::string& doc) {
  return scalar<std::string>(
      key, fallback,
      {fmt::format("one of {}", fmt::join(names, ", ")), "", "", names_schema(names)}, doc,
      names.empty() ? "" : names.front(), [&](const Node& node) { return name_in(node, names); },
      same_text);
}

std::filesystem::path Section::input_file(const std::string& key, Default<std::string> fallback,
                                          const std::string& doc) {
  const std::filesystem::path name = existing_path(key, fallback, "file", doc);
  std::error_code ignored;
  if (!state_->describing && std::filesystem::is_directory(name, ignored)) {
    fail(key, fmt::format("expected a file, found \"{}\", which is a directory", name.string()));
  }
  return name;
}

std::filesystem::path Section::input_path(const std::string& key, Default<std::string> fallback,
                                          const std::string& doc) {
  return existing_path(key, fallback, "file or directory", doc);
}

std::filesystem::path Section::existing_path(const std::string& key,
                                             const Default<std::string>& fallback,
                                             const std::string& kind, const std::string& doc) {
  const bool may_be_none = fallback.value && fallback.value->empty();
  const auto parse = [&](const Node& node) {
    const bool none = may_be_none && node.kind == Node::Kind::scalar && node.text == "none";
    return none ? std::optional<std::string>("") : text_in(node);
  };
  const std::string name =
      scalar<std::string>(key, fallback, {kind, "", "", text_schema()}, doc, "", parse, same_text);
  if (state_->describing || (name.empty() && may_be_none)) return name;
  std::error_code ignored;
  if (!std::filesystem::exists(name, ignored)) {
    fail(key, fmt::format("expected a {}, found \"{}\", which does not exist", kind, name));
  }
  return name;
}

std::optional<double> Section::real_or(const std::string& word, const std::string& key,
                                       Default<std::optional<double>> fallback, const Range& range,
                                       const std::string& unit, const std::string& doc) {
  using Value = std::optional<double>;
  const auto parse = [&](const Node& node) -> std::optional<Value> {
    if (node.kind == Node::Kind::scalar && node.text == word) return Value();
    const auto number = real_in(node, range);
    return number ? std::optional<Value>(number) : std::nullopt;
  };
  const auto show = [&](const Value& value) {
    return value ? plain_real(*value) : same_text(word);
  };
  return scalar<Value>(key, fallback,
                       {real_noun(range), fmt::format("{} or \"{}\"", range.text(), word), unit,
                        or_word_schema(real_schema(range), word)},
                       doc, Value(), parse, show);
}

void Section::one_of(const std::string& key, const std::string& other) {
  const auto given = [&](const std::string& name) {
    const auto node = given_->find(name);
    const bool none = node && node->kind == Node::Kind::scalar && node->text == "none";
    return none ? nullptr : node;
  };
  const auto first = given(key), second = given(other);
  if (first && second) {
    fail(key, fmt::format("expected this or {}, found both ({}: {})", full_path(other),
                          second->origin, second->found()));
  }
  forget(first ? other : key);
}

void Section::none_of(const std::vector<std::string>& keys, const std::string& beside) {
  for (const std::string& key : keys) {
    if (has(key)) fail(key, fmt::format("expected this or {}, found both", full_path(beside)));
    forget(key);
  }
}

bool Section::says(const std::string& key, const std::string& text) const {
  const auto node = given_->find(key);
  return node && node->kind == Node::Kind::scalar && !node->quoted && node->text == text;
}

void Section::forget(const std::string& key) {
  if (state_->describing || has(key)) return;
  auto& read = resolved_->entries;
  read.erase(std::find_if(read.begin(), read.end(),
                          [&](const auto& entry) { return entry.first == key; }));
  state_->absent.push_back(full_path(key));
}

std::vector<double> Section::reals_of(const std::string& key,
                                      const Default<std::vector<double>>& fallback,
                                      const Range& range, const std::string& unit,
                                      const std::string& doc, const Range& sizes) {
  return sequence<double>(
      key, fallback, {real_noun(range), range.text(), unit, real_schema(range)}, doc, sizes,
      some_number(range), [&](const Node& node) { return real_in(node, range); }, plain_real);
}

std::array<double, 3> Section::vector3(const std::string& key,
                                       Default<std::array<double, 3>> fallback, const Range& range,
                                       const std::string& unit, const std::string& doc) {
  Default<std::vector<double>> list(required);
  if (fallback.value) list.value.emplace(fallback.value->begin(), fallback.value->end());
  const auto values = reals_of(key, list, range, unit, doc, between(3, 3));
  return {values[0], values[1], values[2]};
}

std::array<double, 2> Section::interval(const std::string& key,
                                        Default<std::array<double, 2>> fallback, const Range& range,
                                        const std::string& unit, const std::string& doc) {
  Default<std::vector<double>> list(required);
  if (fallback.value) list.value.emplace(fallback.value->begin(), fallback.value->end());
  const auto values = reals_of(key, list, range, unit, doc, between(2, 2));
  if (values[0] > values[1]) {
    fail(key, fmt::format("expected [low, high] with low <= high, found [{}, {}]",
                          format_real(values[0]), format_real(values[1])));
  }
  return {values[0], values[1]};
}

std::vector<double> Section::reals(const std::string& key, Default<std::vector<double>> fallback,
                                   const Range& range, const std::string& unit,
                                   const std::string& doc, const Range& sizes) {
  return reals_of(key, fallback, range, unit, doc, sizes);
}

std::vector<std::int64_t> Section::integers(const std::string& key,
                                            Default<std::vector<std::int64_t>> fallback,
                                            const Range& range, const std::string& unit,
                                            const std::string& doc, const Range& sizes) {
  return sequence<std::int64_t>(
      key, fallback, {"integer", range.text(), unit, integer_schema(range)}, doc, sizes,
      static_cast<std::int64_t>(std::ceil(some_number(range))),
      [&](const Node& node) { return integer_in(node, range); }, plain_integer);
}

std::vector<std::string> Section::texts(const std::string& key,
                                        Default<std::vector<std::string>> fallback,
                                        const std::string& doc, const Range& sizes) {
  return sequence<std::string>(key, fallback, {"text", "", "", text_schema()}, doc, sizes, "text",
                               text_in, same_text);
}

std::vector<std::string> Section::choices(const std::string& key,
                                          Default<std::vector<std::string>> fallback,
                                          const std::vector<std::string>& names,
                                          const std::string& doc, const Range& sizes) {
  const auto values = sequence<std::string>(
      key, fallback,
      {"name", fmt::format(" from {}", fmt::join(names, ", ")), "", names_schema(names)}, doc,
      sizes, names.empty() ? "" : names.front(),
      [&](const Node& node) { return name_in(node, names); }, same_text, true);
  for (std::size_t i = 0; i < values.size() && !state_->describing; ++i) {
    if (std::count(values.begin(), values.end(), values[i]) > 1) {
      fail(key, fmt::format("expected each name once, found \"{}\" twice", values[i]));
    }
  }
  return values;
}

}  // namespace uniphy
