#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/experiment.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

/// Runs of a stage with a chart and a table, with a three.js of their own.
class ReportOption : public ::testing::Test {
 protected:
  ReportOption() {
    scratch_.write("three.min.js", "global.THREE = {}; // WebGLRenderer");
    scratch_.write("c.yaml", "fails: none\n");
    ::setenv(kThreeJsVariable, scratch_.file("three.min.js").c_str(), 1);
  }
  ~ReportOption() override { ::unsetenv(kThreeJsVariable); }

  static RunFunction declare(Section& config) {
    const std::string fails = config.choice("fails", "none", {"none", "early", "late"}, "");
    return [=](RunDirectory& out, Metrics& metrics) {
      asked_ = out.report() != nullptr;
      if (fails == "early") throw Error("nothing was done");
      out.write_table("table.md", "Sums", "| a | b |\n|---|---|\n| 1 | 2 |\n");
      out.write_table("table.md", "Sums", "| a | b |\n|---|---|\n| 3 | 4 |\n");
      metrics.set("sum", 7);
      if (fails == "late") throw Error("half of it <is> missing");
    };
  }

  int run(std::vector<std::string> options) {
    const std::string config = scratch_.file("c.yaml").string();
    const std::string out = scratch_.file("out").string();
    std::vector<const char*> argv{"uniphy_example", config.c_str(), "--out", out.c_str()};
    for (const std::string& option : options) argv.push_back(option.c_str());
    ::testing::internal::CaptureStderr();
    const int code = run_experiment(static_cast<int>(argv.size()), argv.data(),
                                    {"uniphy_example", "Adds numbers.", {}, {}, {}}, declare);
    error_ = ::testing::internal::GetCapturedStderr();
    return code;
  }
  bool has_report() const { return std::filesystem::exists(scratch_.file("out/report.html")); }
  std::string report() const { return read_text_file(scratch_.file("out/report.html")); }

  testing::Scratch scratch_;
  std::string error_;
  static inline bool asked_ = false;
};

TEST_F(ReportOption, WritesAPageBesideTheProducts) {
  ASSERT_EQ(run({"--report"}), 0) << error_;
  EXPECT_TRUE(asked_);
  const std::string html = report();
  EXPECT_THAT(html, HasSubstr("<td class=\"number\">4</td>"));
  EXPECT_THAT(html, ::testing::Not(HasSubstr("<td class=\"number\">2</td>")));
  EXPECT_THAT(html, HasSubstr("<td>sum</td><td class=\"number\">7</td>"));
  EXPECT_THAT(html, HasSubstr("fails: "));
  EXPECT_THAT(read_text_file(scratch_.file("out/table.md")), HasSubstr("| 3 | 4 |"));
}

TEST_F(ReportOption, IsOffUnlessAskedForAndAnOlderPageGoes) {
  ASSERT_EQ(run({"--report"}), 0) << error_;
  ASSERT_EQ(run({}), 0) << error_;
  EXPECT_FALSE(asked_);
  EXPECT_FALSE(has_report());
  ASSERT_EQ(run({"--report", "--no-report"}), 0) << error_;
  EXPECT_FALSE(has_report());
}

TEST_F(ReportOption, ARunThatFailsShowsWhatItHasAndWhy) {
  EXPECT_EQ(run({"--report", "--set", "fails=late"}), 1);
  EXPECT_THAT(report(), HasSubstr("half of it &lt;is&gt; missing"));
  EXPECT_THAT(report(), HasSubstr("<td class=\"number\">4</td>"));
}

TEST_F(ReportOption, ARunThatFailsWithNothingLeavesTheOlderPage) {
  ASSERT_EQ(run({"--report"}), 0) << error_;
  const std::string before = report();
  EXPECT_EQ(run({"--report", "--set", "fails=early"}), 1);
  EXPECT_EQ(report(), before);
}

TEST_F(ReportOption, WithoutThreeJsNothingBegins) {
  ::setenv(kThreeJsVariable, scratch_.file("none.js").c_str(), 1);
  EXPECT_EQ(run({"--report"}), 1);
  EXPECT_THAT(error_, HasSubstr("apt install libjs-three"));
  EXPECT_FALSE(std::filesystem::exists(scratch_.file("out")));
  EXPECT_EQ(run({}), 0) << error_;
}

}  // namespace
}  // namespace uniphy
