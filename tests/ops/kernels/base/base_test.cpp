#include <gtest/gtest.h>
#include <omp.h>

#include <atomic>
#include <cmath>
#include <string>
#include <vector>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/for_each.hpp"
#include "ops/kernels/base/hash.hpp"
#include "ops/kernels/base/statistics.hpp"

namespace uniphy::kernels {
namespace {

TEST(Hash, HasThePublishedValues) {
  // Test vectors of the authors of FNV (64 bits, FNV-1a).
  EXPECT_EQ(Hash().text(), "cbf29ce484222325");
  EXPECT_EQ(Hash().add("a").text(), "af63dc4c8601ec8c");
  EXPECT_EQ(Hash().add("foobar").text(), "85944171f73967e8");
  EXPECT_EQ(Hash().add("foo").add("bar").value(), Hash().add("foobar").value());
}

TEST(Hash, SeesEveryBit) {
  std::vector<double> values{0.25, -1, 3e7};
  const std::uint64_t whole = Hash().add(values).value();
  for (std::size_t bit = 0; bit < 8 * values.size() * sizeof(double); ++bit) {
    auto* bytes = reinterpret_cast<unsigned char*>(values.data());
    bytes[bit / 8] ^= static_cast<unsigned char>(1u << bit % 8);
    EXPECT_NE(Hash().add(values).value(), whole) << bit;
    bytes[bit / 8] ^= static_cast<unsigned char>(1u << bit % 8);
  }
}

TEST(Statistics, MedianAndQuantiles) {
  EXPECT_EQ(median({3, 1, 2}), 2);
  EXPECT_EQ(median({4, 1, 3, 2}), 2.5);
  EXPECT_EQ(median({7}), 7);
  EXPECT_TRUE(std::isnan(median({})));
  std::vector<double> values;
  for (int k = 100; k >= 0; --k) values.push_back(k);
  EXPECT_EQ(quantile(values, 0), 0);
  EXPECT_EQ(quantile(values, 0.995), 99);
  EXPECT_EQ(quantile(values, 1), 100);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

TEST(Statistics, SumsOfSquares) {
  const double a[] = {1, 2, 3}, b[] = {1, 4, 0};
  EXPECT_EQ(sum_of_squares(a, 3), 14);
  EXPECT_EQ(squared_distance(a, b, 3), 13);
}

class ForEach : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    before_ = omp_get_max_threads();
    omp_set_num_threads(GetParam());
  }
  void TearDown() override { omp_set_num_threads(before_); }
  int before_ = 1;
};

TEST_P(ForEach, VisitsAllOnce) {
  std::vector<int> visits(1000, 0);
  for_each(1000, [&](std::ptrdiff_t i) { ++visits[i]; });
  EXPECT_EQ(visits, std::vector<int>(1000, 1));
  for_each(0, [&](std::ptrdiff_t) { FAIL() << "nothing to visit"; });
}

TEST_P(ForEach, ThrowsWhatAPlainLoopWouldThrow) {
  for (int repeat = 0; repeat < 20; ++repeat) {
    std::atomic<int> visited{0};
    try {
      for_each(100000, [&](std::ptrdiff_t i) {
        ++visited;
        if (i == 40 || i == 41 || i == 45) throw Error("at " + std::to_string(i));
      });
      FAIL() << "expected an Error";
    } catch (const Error& error) {
      EXPECT_STREQ(error.what(), "at 40");
    }
    EXPECT_GE(visited, 41);
    EXPECT_LT(visited, 50000) << "what comes after a failure must not begin";
  }
}

TEST_P(ForEach, OneVisitHasAllThreads) {
  int threads = 0;
  for_each(1, [&](std::ptrdiff_t) {
#pragma omp parallel
#pragma omp single
    threads = omp_get_num_threads();
  });
  EXPECT_EQ(threads, GetParam());
}

INSTANTIATE_TEST_SUITE_P(Threads, ForEach, testing::Values(1, 2),
                         [](const auto& info) { return "on_" + std::to_string(info.param); });

}  // namespace
}  // namespace uniphy::kernels
