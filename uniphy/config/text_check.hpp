#pragma once

#include <string>

namespace uniphy {

/// Throws Error `name:line: ...` unless the text is UTF-8 without control characters, without tabs
/// as indentation and not longer than kMaximumBytes.
void check_text(const std::string& text, const std::string& name);

}  // namespace uniphy
