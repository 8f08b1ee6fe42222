#include "uniphy/inference/levenberg_marquardt.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/optim.h>

#include <atomic>
#include <cmath>

#include "ops/base/torch.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/on_threads.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

Tensor numbers(const std::vector<double>& x) { return torch::tensor(x, torch::kFloat64); }

/// r = (x₁ − 1, 1000 (x₀ x₁ − 2), x₀² − 4): zero at (2, 1), with influences a thousandfold apart.
Tensor curved(const Tensor& x) {
  return torch::stack({x[1] - 1, 1000 * (x[0] * x[1] - 2), x[0].square() - 4});
}

int steps_until_done(LevenbergMarquardt& optimizer, const Residuals& residuals) {
  int steps = 0;
  for (; steps < 50 && !optimizer.stuck() && optimizer.loss() > 1e-20; ++steps) {
    optimizer.step(residuals);
  }
  return steps;
}

TEST(LevenbergMarquardt, ConvergesOnACurvedProblem) {
  const Tensor x = numbers({3.0, 0.1});
  LevenbergMarquardt optimizer({x}, LevenbergMarquardtOptions());
  EXPECT_LT(steps_until_done(optimizer, curved), 12);
  EXPECT_LT(optimizer.loss(), 1e-12);
  EXPECT_NEAR(x[0].item<double>(), 2, 1e-6);
  EXPECT_NEAR(x[1].item<double>(), 1, 1e-6);
}

/// Its floor falls a thousandth as steeply as its sides rise, and no number lies along it.
TEST(LevenbergMarquardt, FollowsALongCurvedValleyInFewJacobians) {
  const auto valley = [](const Tensor& x) {
    const Tensor along = (x[0] + x[1]) / std::sqrt(2.0), across = (x[0] - x[1]) / std::sqrt(2.0);
    return torch::stack({1000 * (across - 0.5 * along.square()), along - 3});
  };
  const Tensor x = numbers({-1.0, -1.2});
  LevenbergMarquardt optimizer({x}, LevenbergMarquardtOptions());
  EXPECT_LT(steps_until_done(optimizer, valley), 30);
  EXPECT_LT(optimizer.loss(), 1e-12);
  EXPECT_NEAR((x[0] + x[1]).item<double>() / std::sqrt(2.0), 3, 1e-5);
}

TEST(LevenbergMarquardt, TellsWhatAStepGainedAndWhatItCost) {
  const Tensor x = numbers({3.0, 0.1});
  LevenbergMarquardt optimizer({x}, LevenbergMarquardtOptions());
  int calls = 0;
  const auto counted = [&](const Tensor& u) {
    ++calls;
    return curved(u);
  };
  testing::on_threads(1, [&] {
    const double first = sum_of_squares(curved(x));
    optimizer.step(counted);
    EXPECT_NEAR(optimizer.gained(), first - optimizer.loss(), 1e-9 * first);
    const double before = optimizer.loss();
    optimizer.step(counted);
    EXPECT_NEAR(optimizer.gained(), before - optimizer.loss(), 1e-9 * before);
    return 0;
  });
  EXPECT_EQ(optimizer.evaluations(), calls);
}

TEST(LevenbergMarquardt, EndsWhereTheGradientOfALinearProblemVanishes) {
  const Tensor A = numbers({1, 2, 3, 4, 5, 6.5, 7, 8, -9, 1, 0, 2}).view({4, 3});
  const Tensor b = numbers({1, -2, 0.5, 3}), x = numbers({0, 0, 0});
  LevenbergMarquardt optimizer({x}, LevenbergMarquardtOptions());
  steps_until_done(optimizer, [&](const Tensor& y) { return A.mv(y) - b; });
  EXPECT_GT(optimizer.loss(), 0.1);  // more equations than numbers
  EXPECT_LT(A.t().mv(A.mv(x) - b).norm().item<double>(), 1e-5);
}

TEST(LevenbergMarquardt, LeavesOfSeveralShapesAreOnePoint) {
  const Tensor a = numbers({3.0}), b = numbers({0.1, 7}).view({1, 2});
  LevenbergMarquardt optimizer({a, b}, LevenbergMarquardtOptions());
  steps_until_done(optimizer, [](const Tensor& x) {
    return torch::cat({curved(x.slice(0, 0, 2)), (x[2] - 5).view({1})});
  });
  EXPECT_NEAR(a[0].item<double>(), 2, 1e-6);
  EXPECT_NEAR(b[0][1].item<double>(), 5, 1e-6);
}

TEST(LevenbergMarquardt, WhereThereAreNoResidualsNoStepEnds) {
  const auto walled = [](const Tensor& x) {
    return x[0].item<double>() < 1.9 ? Tensor() : curved(x);
  };
  const Tensor x = numbers({3.0, 0.1});
  LevenbergMarquardt optimizer({x}, LevenbergMarquardtOptions());
  for (int i = 0; i < 50 && !optimizer.stuck(); ++i) {
    optimizer.step(walled);
    EXPECT_GE(x[0].item<double>(), 1.9);
  }
  EXPECT_LT(optimizer.loss(), 1e-12);

  // At the edge, where the step forwards has none, the one backwards gives the column.
  const Tensor edge = numbers({2.1, 1});
  LevenbergMarquardt from_edge({edge}, LevenbergMarquardtOptions());
  steps_until_done(
      from_edge, [](const Tensor& y) { return y[0].item<double>() > 2.1 ? Tensor() : curved(y); });
  EXPECT_NEAR(edge[0].item<double>(), 2, 1e-6);
}

TEST(LevenbergMarquardt, WithoutResidualsAtTheStartItIsStuck) {
  const Tensor x = numbers({3.0, 0.1});
  LevenbergMarquardt optimizer({x}, LevenbergMarquardtOptions());
  const Tensor loss = optimizer.step([](const Tensor&) { return Tensor(); });
  EXPECT_TRUE(std::isinf(loss.item<double>()));
  EXPECT_TRUE(optimizer.stuck());
  EXPECT_EQ(x[0].item<double>(), 3.0);
}

TEST(LevenbergMarquardt, ANumberThatMovesNothingStaysWhereItIs) {
  const Tensor x = numbers({3.0, 0.1, 0.7});
  LevenbergMarquardt optimizer({x}, LevenbergMarquardtOptions());
  steps_until_done(optimizer, [](const Tensor& y) { return curved(y.slice(0, 0, 2)); });
  EXPECT_LT(optimizer.loss(), 1e-12);
  EXPECT_EQ(x[2].item<double>(), 0.7);
}

TEST(LevenbergMarquardt, GoesOnToTheSameBitsOnAnyNumberOfThreads) {
  const auto path = [](int threads, bool interrupted) {
    return testing::on_threads(threads, [&] {
      const Tensor x = numbers({5.0, 0.1});
      auto optimizer =
          std::make_unique<LevenbergMarquardt>(std::vector<Tensor>{x}, LevenbergMarquardtOptions());
      for (int i = 0; i < 5; ++i) {
        optimizer->step(curved);
        if (!interrupted) continue;
        const std::string bytes = optimizer->saved();
        x.fill_(77);
        optimizer = std::make_unique<LevenbergMarquardt>(std::vector<Tensor>{x},
                                                         LevenbergMarquardtOptions());
        optimizer->resume(bytes);
      }
      return std::make_pair(x.clone(), optimizer->evaluations());
    });
  };
  const auto [x, evaluations] = path(1, false);
  for (const auto& [other, count] : {path(2, false), path(1, true)}) {
    EXPECT_TRUE(torch::equal(x, other));
    EXPECT_EQ(count, evaluations);
  }
}

TEST(LevenbergMarquardt, RefusesWhatIsNotItsOwn) {
  const Tensor x = numbers({3.0, 0.1});
  LevenbergMarquardt optimizer({x}, LevenbergMarquardtOptions());
  torch::optim::Optimizer& base = optimizer;
  EXPECT_THAT(testing::error_of([&] { base.step([] { return torch::zeros({}); }); }),
              ::testing::HasSubstr("expected a closure that gives residuals"));
  LevenbergMarquardt longer({numbers({1, 2, 3})}, LevenbergMarquardtOptions());
  EXPECT_THAT(testing::error_of([&] { optimizer.resume(longer.saved()); }),
              ::testing::HasSubstr("expected 2 numbers, found 3"));
  EXPECT_THAT(testing::error_of([&] { optimizer.resume("no archive"); }),
              ::testing::HasSubstr("state of the optimizer: "));
}

}  // namespace
}  // namespace uniphy
