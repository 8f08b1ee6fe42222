#include "uniphy/evaluation/error_table.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace uniphy {
namespace {

TEST(ErrorTable, PercentKeepsTwoFigures) {
  EXPECT_EQ(percent(0), "0");
  EXPECT_EQ(percent(0.004821), "0.48 %");
  EXPECT_EQ(percent(0.994), "99 %");
  EXPECT_EQ(percent(0.996), "100 %");
  EXPECT_EQ(percent(3.456), "346 %");
  EXPECT_EQ(percent(std::nan("")), "fails");
  EXPECT_EQ(percent(std::numeric_limits<double>::infinity()), "fails");
}

TEST(ErrorTable, MediansWithTheWorstBeside) {
  Metrics metrics;
  metrics.set("stress_error.elastic", 0.0048);
  metrics.set("stress_error.elastic.worst", 0.026);
  metrics.set("stress_error.sand", 0.1);
  metrics.set("stress_error.sand.worst", std::numeric_limits<double>::infinity());
  // What elastic projects is not relative to anything.
  metrics.set("unprojected_error.elastic", 0);
  metrics.set("unprojected_error.elastic.worst", 5.2e-7);
  metrics.set("projection_error.sand", 0.05);
  metrics.set("projection_error.sand.worst", 0.06);
  EXPECT_EQ(error_table({{"stress", &metrics, "stress_error"},
                         {"projection", &metrics, "projection_error"},
                         {"absolute", &metrics, "unprojected_error"}},
                        {"elastic", "sand"}),
            "| | elastic | sand |\n"
            "|---|---|---|\n"
            "| stress | 0.48 % (2.6 %) | 10 % (fails) |\n"
            "| projection | – | 5 % (6 %) |\n"
            "| absolute | 0 (5e-07) | – |\n");
}

}  // namespace
}  // namespace uniphy
