#include "uniphy/config/value.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <regex>

namespace uniphy {
namespace {

TEST(ParseReal, TakesDecimalNumbersOnly) {
  EXPECT_EQ(parse_real("1.5"), 1.5);
  EXPECT_EQ(parse_real("+1e-3"), 1e-3);
  EXPECT_EQ(parse_real("-2"), -2.0);
  EXPECT_EQ(parse_real(".5"), 0.5);
  EXPECT_EQ(parse_real(".inf"), std::numeric_limits<double>::infinity());
  EXPECT_TRUE(std::isnan(parse_real(".nan").value()));
  for (const char* text : {"", "abc", "1.5x", " 1", "1 ", "0x10", "1e", "--1", "+-1", "1,5", "inf",
                           "nan", "infinity", "1e400", "1_000"}) {
    EXPECT_FALSE(parse_real(text).has_value()) << text;
  }
}

TEST(ParseInteger, TakesWholeNumbersOnly) {
  EXPECT_EQ(parse_integer("9223372036854775807"), std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(parse_integer("-7"), -7);
  EXPECT_EQ(parse_integer("+7"), 7);
  for (const char* text : {"", "1.0", "1e3", "9223372036854775808", "0x10", "7 ", "seven"}) {
    EXPECT_FALSE(parse_integer(text).has_value()) << text;
  }
}

TEST(ParseBoolean, TakesTrueAndFalseOnly) {
  EXPECT_EQ(parse_boolean("true"), true);
  EXPECT_EQ(parse_boolean("false"), false);
  for (const char* text : {"yes", "no", "1", "True", ""}) {
    EXPECT_FALSE(parse_boolean(text).has_value()) << text;
  }
}

TEST(FormatReal, ReadsBackToTheSameBits) {
  std::mt19937_64 bits(1);
  for (int i = 0; i < 20000; ++i) {
    const std::uint64_t pattern = bits();
    double value;
    std::memcpy(&value, &pattern, sizeof value);
    if (!std::isfinite(value)) continue;
    const auto back = parse_real(format_real(value));
    ASSERT_TRUE(back.has_value()) << format_real(value);
    ASSERT_EQ(*back, value);
  }
  EXPECT_EQ(format_real(std::numeric_limits<double>::infinity()), ".inf");
}

TEST(FormatReal, IsANumberInEveryVersionOfYaml) {
  // "Float" and "int" of yaml.org/type, which YAML 1.1 takes: a point, and a sign in the exponent.
  const std::regex number("[-+]?([0-9]+[.][0-9]*([eE][-+][0-9]+)?|[0-9]+)");
  for (const double value : {5e-5, 1e-300, 1e16, -2e22, 1.25e-7, 0.1, 1000.0, -3.0, 1e15, 1e100}) {
    EXPECT_TRUE(std::regex_match(format_real(value), number)) << format_real(value);
  }
  std::mt19937_64 bits(2);
  for (int i = 0; i < 2000; ++i) {
    const std::uint64_t pattern = bits();
    double value;
    std::memcpy(&value, &pattern, sizeof value);
    if (!std::isfinite(value)) continue;
    ASSERT_TRUE(std::regex_match(format_real(value), number)) << format_real(value);
  }
  EXPECT_EQ(format_real(-0.0), "-0.0");
  EXPECT_TRUE(std::signbit(*parse_real("-0.0")));
  EXPECT_EQ(format_real(5e-5), "5.0e-05");
  EXPECT_EQ(format_real(1e16), "1.0e+16");
}

TEST(Range, ContainsItsClosedEndsOnly) {
  EXPECT_TRUE(between(0, 1).contains(0));
  EXPECT_TRUE(between(0, 1).contains(1));
  EXPECT_FALSE(between(0, 1).contains(std::nextafter(1.0, 2.0)));
  EXPECT_FALSE(positive().contains(0));
  EXPECT_TRUE(positive().contains(5e-324));
  Range half_open = between(0, 1);
  half_open.high_open = true;
  EXPECT_FALSE(half_open.contains(1));
  EXPECT_EQ(half_open.text(), " in [0, 1)");
}

TEST(Range, RefusesWhatIsNotFiniteUnlessAllowed) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(any_number().contains(infinity));
  EXPECT_FALSE(any_number().contains(std::nan("")));
  Range open = any_number();
  open.infinite = true;
  EXPECT_TRUE(open.contains(infinity));
  EXPECT_FALSE(open.contains(std::nan("")));
}

}  // namespace
}  // namespace uniphy
