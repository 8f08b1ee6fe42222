#include "uniphy/report/plot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/plot_labels.hpp"

namespace uniphy {
namespace {

/// Width and height from a PNG's header, {0, 0} where it is not one.
std::pair<unsigned, unsigned> png_size(const std::filesystem::path& file) {
  const std::string bytes = read_text_file(file);
  if (bytes.size() < 24 || bytes.compare(0, 8, "\x89PNG\r\n\x1a\n") != 0) return {0, 0};
  const auto number = [&](std::size_t at) {
    unsigned value = 0;
    for (std::size_t i = 0; i < 4; ++i)
      value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
  };
  return {number(16), number(20)};
}

Chart example_chart() {
  Chart chart;
  chart.title = "a \"title\" with \\ and `id`";
  chart.x_label = "step_number";
  chart.y_label = "loss";
  chart.log_y = true;
  chart.series.push_back({"first", {0, 1, 2, 3}, {1, 0.1, std::nan(""), 0.01}, {}, false});
  chart.series.push_back({"second", {0, 1, 2}, {1, 0, 2}, {1, 2, 3}, true});
  return chart;
}

TEST(Plot, ChartIsAPngOfTheAskedSize) {
  if (!gnuplot_available()) GTEST_SKIP() << "no gnuplot here";
  const testing::Scratch scratch;
  Chart chart = example_chart();
  chart.width = 640;
  chart.height = 480;
  ASSERT_TRUE(plot_chart(scratch.file("a chart's.png"), chart));
  EXPECT_EQ(png_size(scratch.file("a chart's.png")), std::make_pair(640u, 480u));
  // Working files are gone.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch.path()), {}), 1);
}

TEST(Plot, ParticlesFillTheirPanels) {
  if (!gnuplot_available()) GTEST_SKIP() << "no gnuplot here";
  const testing::Scratch scratch;
  ParticlePicture picture;
  picture.columns = 2;
  picture.panel_pixels = 100;
  for (int i = 0; i < 3; ++i) {
    picture.panels.push_back({"panel", {0.1, 0.2, 0.3, 0.5, 0.5, 0.5, NAN, 0, 0}, {}});
  }
  picture.panels.push_back({"no particles", {}, {}});
  ASSERT_TRUE(plot_particles(scratch.file("p.png"), picture));
  const auto [width, height] = png_size(scratch.file("p.png"));
  EXPECT_EQ(width, 200u);
  EXPECT_GT(height, 200u);
}

TEST(Plot, PointsMayHaveNamesAndColours) {
  if (!gnuplot_available()) GTEST_SKIP() << "no gnuplot here";
  const testing::Scratch scratch;
  Chart chart;
  chart.log_x = true;
  chart.colour_label = "value";
  chart.series.push_back({"named", {1, 2}, {1, 2}, {}, true, {"a \"b\"", "5x10 `c` \\ d"}});
  chart.series.push_back({"coloured", {1, 2, 3}, {2, 1, 3}, {1, 2, NAN}, true});
  ::testing::internal::CaptureStderr();
  EXPECT_TRUE(plot_chart(scratch.file("c.png"), chart));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(png_size(scratch.file("c.png")), std::make_pair(900u, 600u));
}

TEST(Plot, NamesThatWouldCoverEachOtherAreLeftOut) {
  Chart chart;
  chart.log_y = true;
  Series series;
  series.points = true;
  for (int i = 0; i < 40; ++i) {
    series.x.push_back(1 + 0.001 * i);
    series.y.push_back(1);
    series.names.push_back("crowd");
  }
  series.x.insert(series.x.end(), {2, 3});
  series.y.insert(series.y.end(), {100, -1});  // the last one cannot be drawn
  series.names.insert(series.names.end(), {"alone", "nowhere"});
  chart.series.push_back(series);
  const std::string commands = label_commands(chart);
  EXPECT_THAT(commands, ::testing::HasSubstr("\"alone\" at first 2, first 100"));
  EXPECT_THAT(commands, ::testing::Not(::testing::HasSubstr("nowhere")));
  const auto lines = std::count(commands.begin(), commands.end(), '\n');
  EXPECT_GE(lines, 3);
  EXPECT_LE(lines, 7);
}

TEST(Plot, HeightsAreFromTheLowestToTheHighest) {
  const auto heights = heights_in_body({0, 2, 0, 0, 4, 0, NAN, NAN, NAN, 0, 3, 0});
  EXPECT_THAT(heights, ::testing::ElementsAre(0, 1, ::testing::NanSensitiveDoubleEq(NAN), 0.5));
  EXPECT_THAT(heights_in_body({0, 2, 0}), ::testing::ElementsAre(0.5));
}

TEST(Plot, AColourBarStandsUnderThePanels) {
  if (!gnuplot_available()) GTEST_SKIP() << "no gnuplot here";
  const testing::Scratch scratch;
  ParticlePicture picture;
  picture.panels.push_back({"0 ms", {0.1, 0.2, 0.3, 0.5, 0.5, 0.5}, {1, NAN}});
  ASSERT_TRUE(plot_particles(scratch.file("without.png"), picture));
  picture.colour_label = "height `in` \"m\"";
  ASSERT_TRUE(plot_particles(scratch.file("with.png"), picture));
  EXPECT_EQ(png_size(scratch.file("with.png")).first, png_size(scratch.file("without.png")).first);
  EXPECT_GT(png_size(scratch.file("with.png")).second,
            png_size(scratch.file("without.png")).second);
}

TEST(Plot, CameraLooksTheRightWay) {
  ParticlePicture picture;
  picture.azimuth = 0;
  picture.elevation = 0;
  const double point[] = {0.75, 0.9, 0.6};
  const Projected front = project_point(picture, point);
  EXPECT_NEAR(front.x, 0.25, 1e-15);
  EXPECT_NEAR(front.y, 0.4, 1e-15);
  EXPECT_NEAR(front.z, 0.1, 1e-15);
  picture.elevation = 90;  // from above: z of the scene points down in the picture
  const Projected above = project_point(picture, point);
  EXPECT_NEAR(above.x, 0.25, 1e-15);
  EXPECT_NEAR(above.y, -0.1, 1e-15);
  EXPECT_NEAR(above.z, 0.4, 1e-15);
  picture.azimuth = 35;
  picture.elevation = 20;
  const Projected any = project_point(picture, point);
  EXPECT_NEAR(std::hypot(any.x, any.y, any.z), std::hypot(0.25, 0.4, 0.1), 1e-15);
}

TEST(Plot, NothingToDrawIsAWarning) {
  const testing::Scratch scratch;
  Chart chart;
  chart.log_y = true;
  chart.series.push_back({"all below zero", {0, 1}, {-1, 0}, {}, false});
  ::testing::internal::CaptureStderr();
  EXPECT_FALSE(plot_chart(scratch.file("c.png"), chart));
  EXPECT_THAT(::testing::internal::GetCapturedStderr(),
              ::testing::HasSubstr("c.png: not drawn, no point can be drawn"));
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

TEST(Plot, MalformedInputIsAnError) {
  const testing::Scratch scratch;
  Chart chart;
  chart.series.push_back({"s", {0, 1}, {1}, {}, false, {}});
  EXPECT_EQ(
      testing::without_directory(
          testing::error_of([&] { plot_chart(scratch.file("c.png"), chart); }), scratch.path()),
      "c.png: series \"s\": expected as many y (and colours) as x (2), found 1 (and 0)");
  chart.series[0] = {"s", {0, 1}, {1, 2}, {}, true, {"one"}};
  EXPECT_EQ(
      testing::without_directory(
          testing::error_of([&] { plot_chart(scratch.file("c.png"), chart); }), scratch.path()),
      "c.png: series \"s\": expected as many names as x (2), found 1");
  ParticlePicture picture;
  EXPECT_EQ(testing::without_directory(
                testing::error_of([&] { plot_particles(scratch.file("p.png"), picture); }),
                scratch.path()),
            "p.png: expected at least one panel");
  picture.panels.push_back({"p", {1, 2}, {}});
  EXPECT_FALSE(testing::error_of([&] { plot_particles(scratch.file("p.png"), picture); }).empty());
}

// Whether there is a gnuplot is asked once a process, hence the death test's fresh one.
TEST(PlotDeathTest, MissingGnuplotIsAWarning) {
  ::testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_EXIT(
      {
        const testing::Scratch scratch;
        ::setenv("PATH", "/nonexistent", 1);
        const bool drawn = plot_chart(scratch.file("c.png"), example_chart());
        std::exit(drawn || gnuplot_available() ? 1 : 0);
      },
      ::testing::ExitedWithCode(0), "warning: .*c.png: not drawn, gnuplot is missing");
}

}  // namespace
}  // namespace uniphy
