#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

namespace uniphy {

/// Marks a key that has no default.
struct Required {};
inline constexpr Required required{};

/// The default of a key: a value, or `required`.
template <class T>
struct Default {
  std::optional<T> value;

  Default(Required) {}  // NOLINT(google-explicit-constructor)
  template <class U, class = std::enable_if_t<std::is_convertible_v<U, T>>>
  Default(U&& value_in)
      : value(std::in_place, std::forward<U>(value_in)) {}  // NOLINT(google-explicit-constructor)
};

/// The values a number may take. Infinities and NaN are never accepted unless `infinite` is set
/// (then ±.inf passes, NaN still does not).
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_open = false;   ///< low itself is excluded
  bool high_open = false;  ///< high itself is excluded
  bool infinite = false;

  bool contains(double value) const;
  /// "", " >= 8", " in [8, 1024]", " > 0", " in (0, 1)"
  std::string text() const;
};

inline Range any_number() { return {}; }
inline Range at_least(double low) { return {low, std::numeric_limits<double>::infinity()}; }
inline Range at_most(double high) { return {-std::numeric_limits<double>::infinity(), high}; }
inline Range above(double low) { return {low, std::numeric_limits<double>::infinity(), true}; }
inline Range positive() { return above(0); }
inline Range between(double low, double high) { return {low, high}; }

/// Strict conversions: the whole text, no locale, no blanks, no hexadecimal. ".inf", "-.inf" and
/// ".nan" are what YAML writes. Empty where the text is not such a number or does not fit.
std::optional<double> parse_real(const std::string& text);
std::optional<std::int64_t> parse_integer(const std::string& text);
std::optional<bool> parse_boolean(const std::string& text);

/// The shortest decimal that reads back to the same bits and is a number in YAML 1.1 and 1.2.
std::string format_real(double value);

}  // namespace uniphy
