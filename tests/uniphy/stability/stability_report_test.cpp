#include "uniphy/stability/stability_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/uniphy/stability/stability_cases.hpp"
#include "tests/uniphy/support/scratch.hpp"

namespace uniphy::stability {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::uniphy::testing::cell_of;

std::vector<Cell> some_cells() {
  std::vector<Cell> cells{cell_of("rotation", "analytic", "sand", Verdict::holds, 1e-11),
                          cell_of("rotation", "analytic", "plasticine", Verdict::holds, 3e-11),
                          cell_of("rotation", "clamped_svd", "sand", Verdict::fails, 0.83),
                          cell_of("rotation", "clamped_svd", "plasticine", Verdict::holds, 1e-9),
                          cell_of("time_step_beyond", "analytic", "4 x", Verdict::stops, 0)};
  cells[2].failure = {3, 14, "its gradient is wrong, \"by 0.83\""};
  for (Cell& c : cells) c.set("finite_share", 1);
  cells[4].numbers.clear();
  cells[4].failure = {5, 2, "left the grid"};
  return cells;
}

TEST(StabilityReport, TheTableShowsSharesAndWorstNumbers) {
  const std::string text = survival_table(some_cells());
  EXPECT_THAT(text, HasSubstr("| stressor | judged by | analytic | clamped_svd |"));
  EXPECT_THAT(text,
              HasSubstr("| rotation | gradient_error | holds 2/2; 3e-11 | **fails** 1/2; 0.83 |"));
  EXPECT_THAT(text, HasSubstr(" stops 0/1; – | – |"));
  EXPECT_THAT(text, Not(HasSubstr("raw_svd |")));
}

TEST(StabilityReport, FailuresHaveStepParticleAndCause) {
  EXPECT_EQ(failures_csv(some_cells()),
            "method,stressor,setting,verdict,step,particle,cause\n"
            "clamped_svd,rotation,\"sand\",fails,3,14,\"its gradient is wrong, \"\"by 0.83\"\"\"\n"
            "analytic,time_step_beyond,\"4 x\",stops,5,2,\"left the grid\"\n");
  EXPECT_THAT(numbers_csv(some_cells()),
              HasSubstr("rotation,clamped_svd,\"sand\",fails,gradient_error,0.83\n"));
}

TEST(StabilityReport, MetricsCountCells) {
  Metrics m;
  add_stability_metrics(some_cells(), m);
  EXPECT_EQ(m.find("survives.rotation.analytic"), 1);
  EXPECT_EQ(m.find("survives.rotation.clamped_svd"), 0.5);
  EXPECT_EQ(m.find("gradient_error.rotation.clamped_svd"), 0.83);
  EXPECT_EQ(m.find("cells_default"), 2);
  EXPECT_EQ(m.find("cells_default_survived"), 2);
  EXPECT_EQ(m.find("gradient_error_max"), 3e-11);
  EXPECT_EQ(m.find("gradient_error_max.clamped_svd"), 0.83);
  EXPECT_EQ(m.find("cells.analytic"), 3);
  EXPECT_EQ(m.find("cells_survived.analytic"), 2);
}

TEST(StabilityReport, TheMapIsDrawn) {
  const ValueMap map = survival_map(some_cells());
  EXPECT_THAT(map.rows, ElementsAre("rotation", "time_step_beyond"));
  EXPECT_THAT(map.columns, ElementsAre("analytic", "clamped_svd"));
  EXPECT_EQ(map.values[1], 0.5);
  EXPECT_TRUE(std::isnan(map.values[3]));
  EXPECT_THAT(map.texts, ElementsAre("2/2", "1/2", "0/1, 1 stop", ""));
  if (!gnuplot_available()) GTEST_SKIP() << "no gnuplot";
  const testing::Scratch scratch;
  EXPECT_TRUE(plot_map(scratch.file("map.png"), map));
  EXPECT_GT(std::filesystem::file_size(scratch.file("map.png")), 1000u);
  ValueMap bad = map;
  bad.texts.pop_back();
  EXPECT_THAT(testing::error_of([&] { plot_map(scratch.file("map.png"), bad); }),
              HasSubstr("expected 4 values and texts"));
}

}  // namespace
}  // namespace uniphy::stability
