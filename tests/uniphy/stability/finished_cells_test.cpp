#include "uniphy/stability/finished_cells.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/uniphy/stability/stability_cases.hpp"
#include "tests/uniphy/support/scratch.hpp"

namespace uniphy::stability {
namespace {

using ::testing::HasSubstr;
using ::uniphy::testing::error_of;

Cell some_cell() {
  Cell cell = testing::cell_of("rotation", "raw_svd", "sand, \"1\"", Verdict::stops, 1.0 / 3);
  cell.set("growth", 1e-300);
  cell.set("never", std::numeric_limits<double>::infinity());
  cell.failure = {12, 7, "left the grid\n\"here\""};
  return cell;
}

TEST(FinishedCells, ComeBackAsTheyWere) {
  const testing::Scratch scratch;
  const FinishedCells finished(scratch.file("cells"));
  const Cell cell = some_cell();
  finished.keep(cell, "seed 1");
  const auto back = finished.find("rotation", "raw_svd", cell.setting, "seed 1");
  ASSERT_TRUE(back);
  EXPECT_EQ(back->verdict, Verdict::stops);
  EXPECT_EQ(back->decided(), 1.0 / 3);
  EXPECT_EQ(back->find("growth"), 1e-300);
  EXPECT_TRUE(std::isnan(*back->find("never")));
  EXPECT_EQ(back->failure.step, 12);
  EXPECT_EQ(back->failure.particle, 7);
  EXPECT_EQ(back->failure.cause, cell.failure.cause);
}

TEST(FinishedCells, AreNotThoseOfOtherSettings) {
  const testing::Scratch scratch;
  const FinishedCells finished(scratch.file("cells"));
  const Cell cell = some_cell();
  finished.keep(cell, "seed 1");
  EXPECT_FALSE(finished.find("rotation", "raw_svd", cell.setting, "seed 2"));
  EXPECT_FALSE(finished.find("rotation", "raw_svd", "sand", "seed 1"));
  EXPECT_FALSE(finished.find("rotation", "analytic", cell.setting, "seed 1"));
}

TEST(FinishedCells, SayWhichFileIsDamaged) {
  const testing::Scratch scratch;
  const FinishedCells finished(scratch.file("cells"));
  const Cell cell = some_cell();
  finished.keep(cell, "");
  for (const auto& entry : std::filesystem::directory_iterator(scratch.file("cells")))
    write_text_file(entry.path(), "{\"stressor\": 1}");
  EXPECT_THAT(error_of([&] { finished.find("rotation", "raw_svd", cell.setting, ""); }),
              HasSubstr("rotation-raw_svd-"));
  EXPECT_THAT(error_of([] { cell_from_json("[1"); }), HasSubstr("not a cell"));
  std::string text = cell_to_json(cell);
  text.replace(text.find("\"stops\""), 7, "\"flies\"");
  EXPECT_THAT(error_of([&] { cell_from_json(text); }), HasSubstr("found flies"));
}

}  // namespace
}  // namespace uniphy::stability
