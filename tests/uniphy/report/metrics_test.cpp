#include "uniphy/report/metrics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

TEST(Metrics, WritesAFlatObjectInOrder) {
  Metrics metrics;
  metrics.set("fit_mse.sand", 0.1);
  metrics.set("frames", 201);
  metrics.set("bad", std::nan(""));
  metrics.set("worse", INFINITY);
  metrics.set("frames", 11);
  EXPECT_EQ(
      metrics.json(),
      "{\n  \"fit_mse.sand\": 0.1,\n  \"frames\": 11,\n  \"bad\": null,\n  \"worse\": null\n}\n");
  EXPECT_EQ(metrics.find("frames"), 11);
  EXPECT_FALSE(metrics.find("none").has_value());
}

TEST(Metrics, ReadsBackToTheSameBits) {
  const testing::Scratch scratch;
  Metrics metrics;
  metrics.set("a", 1.0 / 3);
  metrics.set("b", -1e-300);
  metrics.set("c", std::nan(""));
  metrics.write(scratch.file("metrics.json"));
  const Metrics read = Metrics::read(scratch.file("metrics.json"));
  ASSERT_EQ(read.entries().size(), 3u);
  EXPECT_EQ(read.find("a"), 1.0 / 3);
  EXPECT_EQ(read.find("b"), -1e-300);
  EXPECT_TRUE(std::isnan(*read.find("c")));
}

TEST(Metrics, MalformedFilesAreRefused) {
  const testing::Scratch scratch;
  const auto message = [&](const std::string& text) {
    const auto file = scratch.write("m.json", text);
    return testing::without_directory(testing::error_of([&] { Metrics::read(file); }),
                                      scratch.path());
  };
  EXPECT_EQ(message("[1]"), "m.json: expected an object of numbers, found array");
  EXPECT_EQ(message("{\"a\": \"x\"}"), "m.json: a: expected a number or null, found string");
  EXPECT_THAT(message("{\"a\": 1"), ::testing::StartsWith("m.json: not valid JSON: "));
  EXPECT_EQ(
      testing::without_directory(
          testing::error_of([&] { Metrics::read(scratch.file("none.json")); }), scratch.path()),
      "none.json: expected a file, found nothing of that name");
}

TEST(Metrics, NamesThatNobodyCouldQuoteAreProgrammingErrors) {
  Metrics metrics;
  EXPECT_THROW(metrics.set("wall s", 1), std::logic_error);
  EXPECT_THROW(metrics.set("", 1), std::logic_error);
}

TEST(Metrics, ResourcesAreMeasured) {
  const auto start = std::chrono::steady_clock::now();
  const double before = peak_memory_mb();
  EXPECT_GT(before, 1);
  {
    std::vector<char> block(64 << 20, 1);
    EXPECT_EQ(block[block.size() / 2], 1);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  Metrics metrics;
  metrics.add_resources(start);
  EXPECT_GE(*metrics.find("wall_s"), 0.02);
  EXPECT_GE(*metrics.find("peak_memory_mb"), 60);  // the block is gone, its peak is not
}

}  // namespace
}  // namespace uniphy
