#include "uniphy/config/value.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace uniphy {
namespace {

std::string_view without_plus(const std::string& text) {
  std::string_view view = text;
  if (view.size() > 1 && view[0] == '+' && view[1] != '-') view.remove_prefix(1);
  return view;
}

std::string bound_text(double value) {
  // Bounds are written by hand: 1024 and 1e-12 read better than 1024.0 and 0.000000000001.
  return fmt::format("{:g}", value);
}

}  // namespace

bool Range::contains(double value) const {
  if (std::isnan(value)) return false;
  if (std::isinf(value) && !infinite) return false;
  if (value < low || value > high) return false;
  if (low_open && value == low) return false;
  return !(high_open && value == high);
}

std::string Range::text() const {
  const bool has_low = std::isfinite(low);
  const bool has_high = std::isfinite(high);
  if (has_low && has_high) {
    return fmt::format(" in {}{}, {}{}", low_open ? '(' : '[', bound_text(low), bound_text(high),
                       high_open ? ')' : ']');
  }
  if (has_low) return fmt::format(" {} {}", low_open ? ">" : ">=", bound_text(low));
  if (has_high) return fmt::format(" {} {}", high_open ? "<" : "<=", bound_text(high));
  return "";
}

std::optional<double> parse_real(const std::string& text) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (text == ".inf" || text == "+.inf" || text == ".Inf" || text == ".INF") return infinity;
  if (text == "-.inf" || text == "-.Inf" || text == "-.INF") return -infinity;
  if (text == ".nan" || text == ".NaN" || text == ".NAN") {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const std::string_view view = without_plus(text);
  // from_chars would take "inf" and "nan", which YAML reads as strings.
  for (const char c : view) {
    if ((c < '0' || c > '9') && c != '.' && c != '-' && c != '+' && c != 'e' && c != 'E') return {};
  }
  double value = 0;
  const auto [end, error] = std::from_chars(view.data(), view.data() + view.size(), value);
  if (error != std::errc() || end != view.data() + view.size()) return {};
  return value;
}

std::optional<std::int64_t> parse_integer(const std::string& text) {
  const std::string_view view = without_plus(text);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(view.data(), view.data() + view.size(), value);
  if (error != std::errc() || end != view.data() + view.size()) return {};
  return value;
}

std::optional<bool> parse_boolean(const std::string& text) {
  if (text == "true") return true;
  if (text == "false") return false;
  return {};
}

std::string format_real(double value) {
  if (std::isnan(value)) return ".nan";
  if (std::isinf(value)) return value > 0 ? ".inf" : "-.inf";
  std::string text = fmt::format("{}", value);
  if (text == "-0") return "-0.0";  // as an integer it would lose its sign
  // 5e-05 is text to readers of YAML 1.1 (PyYAML among them), 5.0e-05 is a number to all.
  const std::size_t exponent = text.find('e');
  if (exponent != text.npos && text.find('.') == text.npos) text.insert(exponent, ".0");
  return text;
}

}  // namespace uniphy
