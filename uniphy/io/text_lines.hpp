#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace uniphy {

/// The lines of a text one by one, without their ends (\n, \r\n or \r) and without UTF-8's byte
/// order mark. Keeps views of `text`, which must outlive it.
class TextLines {
 public:
  /// `name` stands for the file in messages. Throws Error for a text in UTF-16.
  TextLines(std::string_view text, std::string name);

  /// Goes to the next line; false at the end.
  bool next();
  /// The words of the line between runs of any of the `separators`.
  std::vector<std::string_view> words(std::string_view separators = " \t") const;
  /// The word as a number. Throws Error that begins with `what` and names file, line and word.
  double number(std::string_view word, const std::string& what) const;

  std::int64_t line_number() const { return number_; }  ///< from 1
  /// Throws Error `name:line: message`.
  [[noreturn]] void fail(const std::string& message) const;

 private:
  std::string_view rest_;
  std::string_view line_;
  std::string name_;
  std::int64_t number_ = 0;
};

/// Strict and independent of the locale: the whole word is one finite number ("+" allowed).
bool parse_number(std::string_view word, double* value);

/// Length of the UTF-8 sequence at text[i], 0 where it is malformed (overlong forms, surrogates and
/// code points above U+10FFFF included).
std::size_t utf8_length(std::string_view text, std::size_t i);
bool is_utf8(std::string_view text);

/// The word between quotation marks for a message: bytes that cannot be printed as \xNN, cut off
/// after 40 characters.
std::string quoted_word(std::string_view word);

}  // namespace uniphy
