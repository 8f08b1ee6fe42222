#include "uniphy/config/text_check.hpp"

#include <fmt/format.h>

#include "ops/kernels/base/error.hpp"
#include "uniphy/config/document.hpp"
#include "uniphy/io/text_lines.hpp"

namespace uniphy {
namespace {

[[noreturn]] void fail(const std::string& name, int line, const std::string& message) {
  throw Error(line > 0 ? fmt::format("{}:{}: {}", name, line, message)
                       : fmt::format("{}: {}", name, message));
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
