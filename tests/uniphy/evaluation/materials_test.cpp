// kind: materials of uniphy_evaluate: its table from rows that are made up, and a tiny run.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/uniphy/evaluation/small_run.hpp"
#include "uniphy/evaluation/evaluate_stage.hpp"
#include "uniphy/evaluation/materials_table.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

MaterialRow row(const std::string& material, const std::string& named) {
  MaterialRow r;
  r.observed = "noise";
  r.object = material;
  r.truth.material = material;
  r.material = named;
  return r;
}

MaterialRow elastic(double mu, double found, double low, double high) {
  MaterialRow r = row("elastic", "elastic");
  r.truth.mu = mu;
  r.found.set("reading.mu", found);
  r.found.set("reading.mu.low", low);
  r.found.set("reading.mu.high", high);
  return r;
}

TEST(MaterialsTable, MediansAndIntervalsThatHoldTheTruth) {
  const std::vector<MaterialRow> rows{elastic(100, 110, 90, 120),  // off by 10 %, holds
                                      elastic(100, 96, 95, 99),    // 4 %, does not
                                      elastic(100, 101, 99, 103),  // 1 %, holds
                                      row("plasticine", "sand")};
  const NumberErrors e = number_errors(rows, "noise", "elastic", "mu");
  EXPECT_EQ(e.objects, 3u);
  EXPECT_EQ(e.read, 3u);
  EXPECT_EQ(e.held, 2u);
  EXPECT_NEAR(e.error, 0.04, 1e-12);
  EXPECT_NEAR(e.width, 0.04, 1e-12);
  EXPECT_EQ(number_errors(rows, "closed", "elastic", "mu").objects, 0u);
  EXPECT_EQ(number_errors(rows, "noise", "plasticine", "mu").objects, 0u);
}

TEST(MaterialsTable, WhatWasNotReadCountsAsNotHeld) {
  MaterialRow missed = row("elastic", "newtonian");
  missed.truth.mu = 100;
  MaterialRow without = elastic(100, 102, NAN, NAN);
  without.found = Metrics();
  without.found.set("reading.mu", 102);
  const NumberErrors e = number_errors({missed, without}, "noise", "elastic", "mu");
  EXPECT_EQ(e.objects, 2u);
  EXPECT_EQ(e.read, 1u);
  EXPECT_EQ(e.held, 0u);
  EXPECT_NEAR(e.error, 0.02, 1e-12);
  EXPECT_TRUE(std::isnan(e.width));
}

TEST(MaterialsTable, MetricsAreOverTheNumbersOfTheirMaterials) {
  std::vector<MaterialRow> rows{elastic(100, 110, 90, 120), elastic(100, 96, 95, 99)};
  MaterialRow sand = row("sand", "plasticine");
  sand.truth.friction_angle = 0.4;
  sand.truth.mu = 7;  // of sand it is not asked for
  rows.push_back(sand);
  Metrics m;
  add_materials_metrics(rows, m);
  EXPECT_EQ(m.find("class_right.noise"), 2);
  EXPECT_EQ(m.find("class_total.noise"), 3);
  EXPECT_EQ(m.find("class_right.noise.sand"), 0);
  EXPECT_NEAR(*m.find("mu_error.noise"), 0.07, 1e-12);
  EXPECT_FALSE(m.find("friction_error.noise"));  // none was read
  EXPECT_NEAR(*m.find("coverage.noise"), 1.0 / 3, 1e-12);
  EXPECT_EQ(m.find("intervals.noise"), 3);
  EXPECT_EQ(m.find("coverage.mu.noise.sand"), 0);
  const std::string table = materials_table(rows);
  EXPECT_THAT(table, HasSubstr("| noise | elastic | 2/2 | 7 %, 1/2 in ±8.5 % | n/a |"));
  EXPECT_THAT(table, HasSubstr("| noise | sand | 0/1 | not read, 0/1 | not read, 0/1 |"));
  EXPECT_THAT(materials_csv(rows), HasSubstr("noise,sand,sand,plasticine,nan,mu,7,nan,nan,nan\n"));
}

TEST(Materials, ReadsObjectsAndGoesOn) {
  const testing::Scratch scratch;
  write_model(scratch.file("model.h5"), testing::readable_model(4));
  const std::string yaml = "kind: materials\nmodel: " + scratch.file("model.h5").string() +
                           "\nmaterials: [elastic]\ncases: [closed, tracked]\n"
                           "objects: {count: 1, steps: 300, particles: 40}\n"
                           "fit: {schedule: {horizon: [1], candidates: [1], epochs: [1]}}\n"
                           "adaptation: {rungs: [latent], samples: 0}\n";
  const auto out = scratch.file("out");
  const Metrics first = testing::run_stage(evaluate_stage, yaml, out);
  EXPECT_EQ(first.find("fits"), 2);
  EXPECT_EQ(first.find("fits_failed"), 0);
  EXPECT_EQ(first.find("class_total.closed"), 1);
  EXPECT_EQ(first.find("class_total.tracked.elastic"), 1);
  EXPECT_THAT(read_text_file(out / "materials.md"), HasSubstr("| tracked | elastic |"));
  EXPECT_THAT(read_text_file(out / "materials.csv"), HasSubstr("closed,elastic_1,elastic,"));
  EXPECT_EQ(testing::run_stage(evaluate_stage, yaml, out, 1).json(), first.json());
}

}  // namespace
}  // namespace uniphy
