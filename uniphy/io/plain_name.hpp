#pragma once

#include <string>

namespace uniphy {

/// Whether a name can be that of a folder and of metrics: letters, digits, _, - and ., no dot
/// first.
inline bool is_plain_name(const std::string& name) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  for (const char c : name) {
    if (!plain(c)) return false;
  }
  return !name.empty() && name[0] != '.';
}

}  // namespace uniphy
