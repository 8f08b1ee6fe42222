#include "uniphy/config/text_check.hpp"

#include <fmt/format.h>

#include "ops/kernels/base/error.hpp"
#include "uniphy/config/document.hpp"

namespace uniphy {
namespace {

[[noreturn]] void fail(const std::string& name, int line, const std::string& message) {
  throw Error(line > 0 ? fmt::format("{}:{}: {}", name, line, message)
                       : fmt::format("{}: {}", name, message));
}

/// Length of the UTF-8 sequence at text[i], 0 where it is malformed (overlong forms, surrogates and
/// code points above U+10FFFF included).
std::size_t utf8_length(const std::string& text, std::size_t i) {
  const auto byte = [&](std::size_t k) {
    return k < text.size() ? static_cast<unsigned char>(text[k]) : 0u;
  };
  const auto follows = [&](std::size_t k) { return (byte(k) & 0xC0u) == 0x80u; };
  const unsigned first = byte(i);
  if (first < 0x80) return 1;
  if (first >= 0xC2 && first <= 0xDF) return follows(i + 1) ? 2 : 0;
  if (first >= 0xE0 && first <= 0xEF) {
    if (!follows(i + 1) || !follows(i + 2)) return 0;
    if (first == 0xE0 && byte(i + 1) < 0xA0) return 0;
    return first == 0xED && byte(i + 1) > 0x9F ? 0 : 3;
  }
  if (first >= 0xF0 && first <= 0xF4) {
    if (!follows(i + 1) || !follows(i + 2) || !follows(i + 3)) return 0;
    if (first == 0xF0 && byte(i + 1) < 0x90) return 0;
    return first == 0xF4 && byte(i + 1) > 0x8F ? 0 : 4;
  }
  return 0;
}

}  // namespace

void check_text(const std::string& text, const std::string& name) {
  if (text.size() > kMaximumBytes) {
    fail(name, 0, fmt::format("expected at most {} bytes, found {}", kMaximumBytes, text.size()));
  }
  int line = 1;
  bool indentation = true;
  for (std::size_t i = 0; i < text.size();) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c == '\n') {
      ++line;
      indentation = true;
      ++i;
      continue;
    }
    if (c == '\t' && indentation) {
      fail(name, line, "expected blanks as indentation, found a tab");
    }
    if ((c < 0x20 && c != '\t' && c != '\r') || c == 0x7F) {
      fail(name, line, fmt::format("expected text, found the control character 0x{:02x}", c));
    }
    const std::size_t length = utf8_length(text, i);
    if (length == 0) {
      fail(name, line, fmt::format("expected UTF-8 text, found the byte 0x{:02x}", c));
    }
    indentation = indentation && c == ' ';
    i += length;
  }
}

}  // namespace uniphy
