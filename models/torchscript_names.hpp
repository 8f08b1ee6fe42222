#pragma once

#include <c10/core/ScalarType.h>
#include <c10/util/Exception.h>

#include <string>

namespace uniphy::models {

inline std::string dtype_name(c10::ScalarType dtype) {
  if (dtype == c10::ScalarType::Float) return "float32";
  if (dtype == c10::ScalarType::Double) return "float64";
  return c10::toString(dtype);
}

/// The first line of what LibTorch says, without its stack trace.
inline std::string first_line(const c10::Error& e) {
  const std::string text = e.what_without_backtrace();
  return text.substr(0, text.find('\n'));
}

}  // namespace uniphy::models
