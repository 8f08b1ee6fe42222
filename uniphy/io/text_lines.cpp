#include "uniphy/io/text_lines.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <utility>

#include "ops/kernels/base/error.hpp"

namespace uniphy {

TextLines::TextLines(std::string_view text, std::string name)
    : rest_(text), name_(std::move(name)) {
  const std::string_view start = text.substr(0, 2);
  if (start == "\xff\xfe" || start == "\xfe\xff") {
    throw Error(name_ + ": expected text in ASCII or UTF-8, found UTF-16");
  }
  if (text.substr(0, 3) == "\xef\xbb\xbf") rest_.remove_prefix(3);
}

bool TextLines::next() {
  if (rest_.empty()) return false;
  const std::size_t end = rest_.find_first_of("\r\n");
  line_ = rest_.substr(0, end);
  rest_.remove_prefix(end == rest_.npos ? rest_.size() : end);
  if (rest_.substr(0, 2) == "\r\n") {
    rest_.remove_prefix(2);
  } else if (!rest_.empty()) {
    rest_.remove_prefix(1);
  }
  ++number_;
  return true;
}

std::vector<std::string_view> TextLines::words(std::string_view separators) const {
  std::vector<std::string_view> words;
  std::size_t start = line_.find_first_not_of(separators);
  while (start != line_.npos) {
    const std::size_t end = line_.find_first_of(separators, start);
    words.push_back(line_.substr(start, end - start));
    start = line_.find_first_not_of(separators, end);
  }
  return words;
}

double TextLines::number(std::string_view word, const std::string& what) const {
  double value = 0;
  if (!parse_number(word, &value))
    fail(what + "expected a finite number, found " + quoted_word(word));
  return value;
}

void TextLines::fail(const std::string& message) const {
  throw Error(fmt::format("{}:{}: {}", name_, number_, message));
}

bool parse_number(std::string_view word, double* value) {
  if (!word.empty() && word[0] == '+') word.remove_prefix(1);
  const auto end = std::from_chars(word.data(), word.data() + word.size(), *value);
  return end.ec == std::errc() && end.ptr == word.data() + word.size() && std::isfinite(*value);
}

std::size_t utf8_length(std::string_view text, std::size_t i) {
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

bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    if (length == 0) return false;
    i += length;
  }
  return true;
}

std::string quoted_word(std::string_view word) {
  std::string text = "\"";
  for (const char c : word.substr(0, 40)) {
    const auto byte = static_cast<unsigned char>(c);
    text += byte < 0x20 || byte >= 0x7f ? fmt::format("\\x{:02x}", byte) : std::string(1, c);
  }
  return text + (word.size() > 40 ? "...\"" : "\"");
}

}  // namespace uniphy
