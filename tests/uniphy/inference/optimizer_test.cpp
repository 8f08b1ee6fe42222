#include "uniphy/inference/optimizer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double rosenbrock(const std::vector<double>& u, std::vector<double>* g) {
  const double a = 1 - u[0], b = u[1] - u[0] * u[0];
  *g = {-2 * a - 400 * b * u[0], 200 * b};
  return a * a + 100 * b * b;
}

double minimise(Optimizer& optimizer, int evaluations) {
  double best = kInfinity;
  for (int i = 0; i < evaluations; ++i) {
    std::vector<double> g;
    const double f = rosenbrock(optimizer.ask(), &g);
    best = std::min(best, f);
    optimizer.tell(f, g);
  }
  return best;
}

TEST(Optimizer, BfgsFollowsACurvedValley) {
  OptimizerOptions options;
  options.rate = 0.5;
  const auto optimizer = make_optimizer(options, {-1.2, 1});
  EXPECT_LT(minimise(*optimizer, 60), 1e-16);
}

TEST(Optimizer, AdamGoesDown) {
  OptimizerOptions options;
  options.method = "adam";
  options.rate = 0.1;
  options.epochs = 400;
  const auto optimizer = make_optimizer(options, {-1.2, 1});
  EXPECT_LT(minimise(*optimizer, 400), 1);  // from 24.2, along the valley
}

class EachOptimizer : public ::testing::TestWithParam<const char*> {
 protected:
  OptimizerOptions options() const {
    OptimizerOptions o;
    o.method = GetParam();
    o.epochs = 30;
    return o;
  }
};

TEST_P(EachOptimizer, GoesOnToTheSameBitsFromItsPackedState) {
  const auto whole = make_optimizer(options(), {-1.2, 1});
  minimise(*whole, 7);
  const auto resumed = make_optimizer(options(), {0, 0});
  resumed->unpack(whole->pack());
  minimise(*whole, 20);
  minimise(*resumed, 20);
  EXPECT_EQ(whole->ask(), resumed->ask());
  EXPECT_EQ(whole->pack(), resumed->pack());
}

TEST_P(EachOptimizer, StepsBackFromWhereThereIsNoLoss) {
  const auto optimizer = make_optimizer(options(), {3, 0.5});
  // x² + y², nothing where x < 1.
  double best = kInfinity;
  for (int i = 0; i < 30; ++i) {
    const std::vector<double> u = optimizer->ask();
    for (const double x : u) ASSERT_TRUE(std::isfinite(x));
    if (u[0] < 1) {
      optimizer->tell(kInfinity, {});
      continue;
    }
    const double f = u[0] * u[0] + u[1] * u[1];
    best = std::min(best, f);
    optimizer->tell(f, {2 * u[0], 2 * u[1]});
  }
  EXPECT_LT(best, 9.25 * 0.75);
}

TEST_P(EachOptimizer, AFlatPlaceAndAFailureAtOnceAreBorne) {
  const auto flat = make_optimizer(options(), {1, 2});
  for (int i = 0; i < 5; ++i) flat->tell(1, {0, 0});
  EXPECT_EQ(flat->ask(), (std::vector<double>{1, 2}));
  const auto failing = make_optimizer(options(), {1, 2});
  for (int i = 0; i < 5; ++i) failing->tell(kInfinity, {});
  EXPECT_EQ(failing->ask(), (std::vector<double>{1, 2}));
}

TEST_P(EachOptimizer, AStateOfAnotherSizeIsRefused) {
  const auto two = make_optimizer(options(), {1, 2});
  const auto three = make_optimizer(options(), {1, 2, 3});
  EXPECT_THAT(testing::error_of([&] { two->unpack(three->pack()); }),
              ::testing::HasSubstr("state of the optimizer: expected"));
}

INSTANTIATE_TEST_SUITE_P(Methods, EachOptimizer, ::testing::Values("bfgs", "adam"),
                         [](const auto& info) { return std::string(info.param); });

TEST(Optimizer, TheInheritedShapeOfTheProblemSavesEvaluations) {
  // An ill-conditioned parabola, then the same one ten times as steep.
  const auto run = [](Optimizer& optimizer, double factor, int evaluations) {
    const double curvature[] = {1, 30, 1000};
    double best = kInfinity;
    for (int i = 0; i < evaluations; ++i) {
      const std::vector<double> u = optimizer.ask();
      std::vector<double> g;
      double f = 0;
      for (int k = 0; k < 3; ++k) {
        f += factor * curvature[k] * u[k] * u[k];
        g.push_back(2 * factor * curvature[k] * u[k]);
      }
      best = std::min(best, f);
      optimizer.tell(f, g);
    }
    return best;
  };
  OptimizerOptions options;
  options.rate = 0.5;
  const auto first = make_optimizer(options, {1, 1, 1});
  run(*first, 1, 12);  // not until rounding rules
  const auto heir = make_optimizer(options, {0.3, 0.2, -0.3});
  heir->inherit(first->pack());
  const auto fresh = make_optimizer(options, {0.3, 0.2, -0.3});
  EXPECT_LT(run(*heir, 10, 5), 1e-2 * run(*fresh, 10, 5));
}

TEST(Optimizer, AnUnknownMethodIsRefused) {
  OptimizerOptions options;
  options.method = "newton";
  EXPECT_THAT(testing::error_of([&] { make_optimizer(options, {0}); }),
              ::testing::HasSubstr("expected adam or bfgs, found \"newton\""));
}

}  // namespace
}  // namespace uniphy
