#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "uniphy/config/document.hpp"
#include "uniphy/config/value.hpp"
#include "uniphy/io/text_lines.hpp"

namespace uniphy {
namespace {

bool is_plain(const std::string& text) {
  if (text.empty()) return false;
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '.' || c == '/' || c == '-' || c == '+';
  };
  if (!std::all_of(text.begin(), text.end(), plain)) return false;
  // "---" and "..." end documents, "-" starts a list.
  return text[0] != '-' || parse_real(text).has_value();
}

/// Whether a plain text could be read as something other than a string, by YAML 1.1 too: 1:30 is
/// ninety there, 0b1 is one, 2001-01-01 a date, and "no" is false.
bool looks_typed(const std::string& text) {
  static const char* const words[] = {"null", "true", "false", "yes", "no", "on", "off", "y", "n"};
  std::string lower = text;
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  const std::size_t first = text.find_first_not_of("+-.");
  return first == text.npos || (text[first] >= '0' && text[first] <= '9') ||
         parse_real(text).has_value() ||
         std::find(std::begin(words), std::end(words), lower) != std::end(words);
}

/// Characters that some reader of YAML refuses or takes for the end of a line, even in quotes:
/// controls, the marks of Unicode's own lines, paragraphs and byte order, and what is none.
bool is_special(std::string_view character) {
  if (character.size() == 1) return character[0] < ' ' || character[0] == 0x7F;
  if (character.size() == 2) return character[0] == '\xC2' && character[1] < '\xA0';
  return character == "\xE2\x80\xA8" || character == "\xE2\x80\xA9" ||
         character == "\xEF\xBB\xBF" || character == "\xEF\xBF\xBE" || character == "\xEF\xBF\xBF";
}

/// The number of a character of at most three bytes of UTF-8.
unsigned code_point(std::string_view character) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(character[i]); };
  if (character.size() == 1) return byte(0);
  if (character.size() == 2) return (byte(0) & 0x1Fu) << 6 | (byte(1) & 0x3Fu);
  return (byte(0) & 0x0Fu) << 12 | (byte(1) & 0x3Fu) << 6 | (byte(2) & 0x3Fu);
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = std::max<std::size_t>(1, utf8_length(text, i));
    const std::string_view character = std::string_view(text).substr(i, length);
    if (character == "\"" || character == "\\") {
      out += '\\';
      out += character;
    } else if (character == "\n") {
      out += "\\n";
    } else if (character == "\t") {
      out += "\\t";
    } else if (character == "\r") {
      out += "\\r";
    } else if (is_special(character)) {
      out += fmt::format("\\u{:04X}", code_point(character));
    } else {
      out += character;
    }
    i += length;
  }
  return out + '"';
}

std::string scalar_text(const Node& node) {
  if (node.kind == Node::Kind::null) return "null";
  if (node.quoted && looks_typed(node.text)) return quoted(node.text);
  return is_plain(node.text) ? node.text : quoted(node.text);
}

bool is_flat(const Node& node) {
  return std::none_of(node.items.begin(), node.items.end(), [](const auto& item) {
    return item->kind == Node::Kind::map || item->kind == Node::Kind::list;
  });
}

void emit(const Node& node, int indent, bool inline_first, std::string& out);

/// What follows "key:" or "-".
void emit_value(const Node& node, int indent, std::string& out) {
  if (node.kind == Node::Kind::map && !node.entries.empty()) {
    out += '\n';
    emit(node, indent + 2, false, out);
  } else if (node.kind == Node::Kind::map) {
    out += " {}\n";
  } else if (node.kind == Node::Kind::list && is_flat(node)) {
    out += " [";
    for (std::size_t i = 0; i < node.items.size(); ++i) {
      out += (i ? ", " : "") + scalar_text(*node.items[i]);
    }
    out += "]\n";
  } else if (node.kind == Node::Kind::list) {
    out += '\n';
    emit(node, indent + 2, false, out);
  } else {
    out += " " + scalar_text(node) + "\n";
  }
}

void emit(const Node& node, int indent, bool inline_first, std::string& out) {
  const std::string blanks(static_cast<std::size_t>(indent), ' ');
  bool first = inline_first;
  for (const auto& [key, value] : node.entries) {
    out += first ? "" : blanks;
    first = false;
    out += (is_plain(key) && !looks_typed(key) ? key : quoted(key)) + ":";
    emit_value(*value, indent, out);
  }
  for (const auto& item : node.items) {
    out += blanks + "-";
    if (item->kind == Node::Kind::map && !item->entries.empty()) {
      out += ' ';
      emit(*item, indent + 2, true, out);
    } else {
      emit_value(*item, indent, out);
    }
  }
}

}  // namespace

std::string emit_document(const Node& root) {
  std::string out;
  emit(root, 0, false, out);
  return out;
}

}  // namespace uniphy
