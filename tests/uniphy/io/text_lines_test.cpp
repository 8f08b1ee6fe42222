#include "uniphy/io/text_lines.hpp"

#include <gtest/gtest.h>

#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using Lines = std::vector<std::string>;

Lines all_lines(const std::string& text) {
  Lines result;
  TextLines lines(text, "text");
  while (lines.next()) {
    std::string joined;
    for (const auto word : lines.words()) joined += (joined.empty() ? "" : "|") + std::string(word);
    result.push_back(joined);
    EXPECT_EQ(lines.line_number(), static_cast<std::int64_t>(result.size()));
  }
  return result;
}

TEST(TextLines, EndsOfEverySystem) {
  const Lines expected{"a|b", "", "c"};
  EXPECT_EQ(all_lines("a b\n\nc"), expected);
  EXPECT_EQ(all_lines(" a\t b \n\nc\n"), expected);
  EXPECT_EQ(all_lines("a b\r\n\r\nc\r\n"), expected);
  EXPECT_EQ(all_lines("a b\r\rc\r"), expected);
  EXPECT_EQ(all_lines(""), Lines{});
}

TEST(TextLines, ByteOrderMarks) {
  EXPECT_EQ(all_lines("\xef\xbb\xbf"
                      "1 2"),
            Lines{"1|2"});
  EXPECT_EQ(testing::error_of([] {
              all_lines(
                  std::string("\xff\xfe"
                              "1\0",
                              4));
            }),
            "text: expected text in ASCII or UTF-8, found UTF-16");
}

TEST(TextLines, NamesLineAndWord) {
  TextLines lines("1\n+2.5 1e999 3x", "points.txt");
  lines.next();
  lines.next();
  const auto words = lines.words();
  EXPECT_EQ(lines.number(words[0], ""), 2.5);
  EXPECT_EQ(testing::error_of([&] { lines.number(words[1], "vertex: "); }),
            "points.txt:2: vertex: expected a finite number, found \"1e999\"");
  EXPECT_EQ(testing::error_of([&] { lines.number(words[2], ""); }),
            "points.txt:2: expected a finite number, found \"3x\"");
}

TEST(TextLines, QuotesWhatCanBePrinted) {
  EXPECT_EQ(quoted_word("a\x01\xff"
                        "b"),
            "\"a\\x01\\xffb\"");
  EXPECT_EQ(quoted_word(std::string(100, 'x')), "\"" + std::string(40, 'x') + "...\"");
}

}  // namespace
}  // namespace uniphy
