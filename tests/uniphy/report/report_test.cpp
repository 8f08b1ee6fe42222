#include "uniphy/report/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/report/report_text.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kThree = "global.THREE = {}; // WebGLRenderer </script> <!--";
constexpr const char* kNasty = "</script><b>'\"&\xff";

Motion example_motion(std::int64_t particles, std::int64_t frames) {
  Motion motion;
  motion.name = kNasty;
  motion.particles = particles;
  motion.body.assign(static_cast<std::size_t>(particles), 0);
  for (std::int64_t f = 0; f < frames; ++f) {
    motion.time.push_back(0.01 * double(f));
    for (std::int64_t i = 0; i < 3 * particles; ++i) {
      motion.x.push_back(static_cast<float>(std::fmod(0.618 * double(i) + 0.01 * double(f), 1)));
    }
  }
  return motion;
}

Report example_report() {
  Report report;
  report.tables.push_back({kNasty, "| a | b |\n|---|---|\n| 1 | </td><script> |\n"});
  report.playbacks.push_back({kNasty, {example_motion(20, 5)}, {kNasty}});
  Chart chart;
  chart.title = kNasty;
  chart.series.push_back({kNasty, {1, 2}, {NAN, 3}, {}, true, {kNasty, "b"}});
  report.charts.push_back(chart);
  return report;
}

ReportRun example_run() {
  ReportRun run;
  run.name = run.summary = run.source = run.config = run.failure = kNasty;
  run.metrics.set("a<b", 1);
  return run;
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; ++at) ++count;
  return count;
}

TEST(Report, NothingThatIsPutInEndsAScriptOrMakesAnElement) {
  const std::string html = report_html(example_report(), example_run(), kThree);
  // As many beginnings as ends, none of them from a text that was put in.
  EXPECT_EQ(count_of(html, "<script"), count_of(html, "</script"));
  EXPECT_THAT(html, Not(HasSubstr("<b>'")));
  EXPECT_THAT(html, Not(HasSubstr("</td><script>")));
  EXPECT_THAT(html, Not(HasSubstr("a<b")));
  EXPECT_THAT(html, HasSubstr("&lt;/script&gt;&lt;b&gt;&#39;&quot;&amp;"));
  EXPECT_THAT(html, Not(HasSubstr("{{")));
}

TEST(Report, FetchesNothing) {
  const std::string html = report_html(example_report(), example_run(), kThree);
  for (const char* part : {"src=", "href=", "url(", "@import", "fetch(", "XMLHttpRequest"}) {
    EXPECT_THAT(html, Not(HasSubstr(part)));
  }
}

TEST(Report, HasTheSameBitsForTheSameRun) {
  EXPECT_EQ(report_html(example_report(), example_run(), kThree),
            report_html(example_report(), example_run(), kThree));
}

TEST(Report, KeepsToItsSizeAndSaysWhatItLeftOut) {
  Report report;
  report.playbacks.push_back({"noise", {example_motion(400, 60)}});
  const std::string whole = report_html(report, {}, kThree);
  EXPECT_THAT(whole, Not(HasSubstr("is shown")));
  const std::size_t rest = report_html({{}, {Playback()}, {}}, {}, kThree).size();
  for (const std::size_t room : {100'000, 30'000, 3'000}) {
    const std::string small = report_html(report, {}, kThree, rest + room);
    EXPECT_LE(small.size(), rest + room);
    if (room < 10'000) {
      EXPECT_THAT(small, HasSubstr("frames is shown"));
    }
  }
  EXPECT_THAT(testing::error_of([&] { report_html(report, {}, kThree, 1000); }),
              HasSubstr("expected tables and charts of at most 1000 bytes"));
  EXPECT_THAT(testing::error_of([&] { report_html(report, {}, kThree, rest + 10); }),
              HasSubstr("expected motions that fit"));
}

/// A cloud that falls, bounces and sways, with noise of 0.05 mm.
Motion large_motion(const std::string& name, double sway) {
  constexpr std::int64_t kParticles = 20'000, kFrames = 200;
  std::mt19937 draw(5);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<double> start(3 * kParticles);
  for (double& x : start) x = 0.3 + 0.4 * unit(draw);
  Motion motion;
  motion.name = name;
  motion.particles = kParticles;
  motion.body.assign(kParticles, 0);
  for (std::int64_t f = 0; f < kFrames; ++f) {
    const double time = 0.004 * double(f);
    motion.time.push_back(time);
    const double height = 0.2 * std::abs(std::cos(5 * time)) - 0.2;
    for (std::size_t i = 0; i < start.size(); ++i) {
      const double swing = sway * time * std::sin(8 * start[i - i % 3] + 9 * time + double(i % 3));
      motion.x.push_back(static_cast<float>(start[i] + swing + (i % 3 == 1 ? height : 0) +
                                            5e-5 * (unit(draw) - 0.5)));
      if (i % 3 != 0) continue;
      motion.plastic_strain.push_back(static_cast<float>(std::abs(swing)));
      motion.error.push_back(static_cast<float>(1e-4 + std::abs(swing) * 1e-2));
    }
  }
  return motion;
}

TEST(Report, ThreeMotionsOfTwentyThousandParticlesKeepAllOfTheirFrames) {
  Report report;
  report.playbacks.push_back({"large",
                              {large_motion("observed", 0.1), large_motion("fitted", 0.1),
                               large_motion("predicted", 0.2)}});
  report.playbacks[0].motions[0].plastic_strain.clear();
  report.playbacks[0].motions[0].error.clear();
  const std::string three(850'000, ' ');  // as long as three.min.js
  const std::string html = report_html(report, {}, three);
  RecordProperty("bytes", static_cast<int>(html.size()));
  EXPECT_LE(html.size(), 20'000'000u);
  EXPECT_THAT(html.substr(0, html.find("id=\"blob-0\"")), Not(HasSubstr("is shown")));
}

TEST(Report, LeavesOutAMotionWithoutFrames) {
  Report report;
  report.playbacks.push_back({"one of two", {example_motion(5, 0), example_motion(5, 3)}});
  const std::string html = report_html(report, {}, kThree);
  EXPECT_EQ(count_of(html, "\"frames\":"), 1u);
  EXPECT_THAT(html, HasSubstr("\"frames\":3"));
}

TEST(Report, WithoutMotionsThereIsNoThreeJs) {
  EXPECT_THAT(report_html({}, {}, "global.THREE"), Not(HasSubstr("<script>global.THREE")));
  EXPECT_THAT(report_html(example_report(), {}, "global.THREE"), HasSubstr("<script>global.THREE"));
}

TEST(Report, ALaterTableTakesThePlaceOfOneOfItsTitle) {
  Report report;
  report.set_table("a", "1");
  report.set_table("b", "2");
  report.set_table("a", "3");
  ASSERT_EQ(report.tables.size(), 2u);
  EXPECT_EQ(report.tables[0].text, "3");
}

TEST(Report, MarkdownBecomesTablesAndParagraphs) {
  const std::string html = html_of_markdown(
      "Words,\nmore <words>.\n\n| name | value |\n|---|---|\n| a | -1.5 % |\n| b |  |\n");
  EXPECT_THAT(html, HasSubstr("<p>Words, more &lt;words&gt;.</p>"));
  EXPECT_THAT(html, HasSubstr("<thead><tr><th>name</th><th>value</th></tr>"));
  EXPECT_THAT(html, HasSubstr("<tr><td>a</td><td class=\"number\">-1.5 %</td></tr>"));
  EXPECT_THAT(html, HasSubstr("<tr><td>b</td><td></td></tr>"));
  EXPECT_THAT(html_of_markdown("a   b\n1   2\n"), HasSubstr("a   b\n1   2\n</pre>"));
}

TEST(ThreeJs, MissingItNamesThePackage) {
  const testing::Scratch scratch;
  const std::string error =
      testing::error_of([&] { find_three_js({scratch.file("three.min.js")}); });
  EXPECT_THAT(error, HasSubstr("apt install libjs-three"));
  EXPECT_THAT(error, HasSubstr("UNIPHY_THREE_JS"));
  EXPECT_THAT(error, HasSubstr("three.min.js"));
}

TEST(ThreeJs, AnotherFileIsRefused) {
  const testing::Scratch scratch;
  const auto file = scratch.write("three.min.js", "export class WebGLRenderer {}");
  EXPECT_THAT(testing::error_of([&] { find_three_js({file}); }),
              HasSubstr("expected three.min.js of libjs-three, found another file"));
}

TEST(ThreeJs, IsReadFromTheFirstFileThatIsThere) {
  const testing::Scratch scratch;
  const auto file = scratch.write("b.js", kThree);
  EXPECT_EQ(find_three_js({scratch.file("a.js"), file}), kThree);
}

}  // namespace
}  // namespace uniphy
