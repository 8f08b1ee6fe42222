#include "uniphy/inference/descent.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "ops/base/torch.hpp"
#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<Tensor> point(const std::vector<double>& x) {
  return {torch::tensor(x, torch::kFloat64).requires_grad_()};
}

Tensor rosenbrock(const Tensor& x) {
  return (1 - x[0]).square() + 100 * (x[1] - x[0].square()).square();
}

/// A function with what was asked of it.
struct Task {
  std::function<Tensor(const Tensor&)> function;
  std::function<bool(const Tensor&)> fails = [](const Tensor&) { return false; };
  double best = kInfinity;
  int calls = 0, failures = 0, repeated = 0;
  std::vector<Tensor> seen = {};

  Tensor at(const std::vector<Tensor>& leaves) {
    ++calls;
    const Tensor& x = leaves[0];
    EXPECT_TRUE(x.isfinite().all().item<bool>());
    for (const Tensor& earlier : seen) repeated += torch::equal(earlier, x) ? 1 : 0;
    seen.push_back(x.detach().clone());
    if (fails(x)) {
      ++failures;
      return torch::scalar_tensor(kInfinity, torch::kFloat64);
    }
    x.mutable_grad() = Tensor();
    const torch::AutoGradMode with_gradient(true);
    const Tensor f = function(x);
    f.backward();
    best = std::min(best, f.item<double>());
    return f;
  }
};

/// At most `steps` steps; returns the best value.
double run(Descent& descent, Task& task, int steps = 1000) {
  for (int i = 0; i < steps && !descent.done(); ++i) {
    descent.step([&] { return task.at(descent.leaves()); });
  }
  return task.best;
}

DescentOptions options_of(const std::string& method, int epochs, double rate) {
  DescentOptions options;
  options.method = method;
  options.epochs = epochs;
  options.rate = rate;
  options.patience = epochs;
  return options;
}

TEST(Lbfgs, FollowsACurvedValley) {
  Descent descent(options_of("lbfgs", 60, 0.5), point({-1.2, 1}));
  Task task{rosenbrock};
  EXPECT_LT(run(descent, task), 1e-16);
  EXPECT_EQ(task.repeated, 0);  // Torch's own begins every step where the last one ended
}

TEST(Descent, AdamwGoesDown) {
  Descent descent(options_of("adamw", 400, 0.1), point({-1.2, 1}));
  Task task{rosenbrock};
  EXPECT_LT(run(descent, task), 0.6);  // from 24.2, along the valley
}

class EachOptimizer : public ::testing::TestWithParam<const char*> {};

TEST_P(EachOptimizer, GoesOnToTheSameBitsFromItsSavedState) {
  const DescentOptions options = options_of(GetParam(), 40, 0.1);
  Descent whole(options, point({-1.2, 1}));
  Task task{rosenbrock};
  run(whole, task, 5);
  Descent resumed(options, point({0, 0}));
  resumed.load(whole.save());
  EXPECT_EQ(resumed.evaluations(), whole.evaluations());
  Task first{rosenbrock}, second{rosenbrock};
  run(whole, first);
  run(resumed, second);
  EXPECT_GT(first.calls, 5);
  EXPECT_EQ(first.calls, second.calls);
  EXPECT_EQ(first.best, second.best);
  EXPECT_TRUE(torch::equal(whole.leaves()[0], resumed.leaves()[0]));
}

TEST_P(EachOptimizer, StepsBackFromWhereThereIsNoLoss) {
  Descent descent(options_of(GetParam(), 40, 1), point({3, 0.5}));
  Task task{[](const Tensor& x) { return x.square().sum(); },
            [](const Tensor& x) { return x[0].item<double>() < 1; }};
  // 9.25 at the start, more than 1 wherever there is a loss.
  EXPECT_LT(run(descent, task), 1.2);
  EXPECT_GT(task.failures, 0);
  EXPECT_GT(task.calls, task.failures + 1);
}

TEST_P(EachOptimizer, AFlatPlaceAndAFailureAtOnceAreBorne) {
  Descent flat(options_of(GetParam(), 20, 0.1), point({1, 2}));
  Task level{[](const Tensor& x) { return 1 + 0 * x.sum(); }};
  run(flat, level);
  EXPECT_TRUE(torch::equal(flat.leaves()[0].detach(), point({1, 2})[0].detach()));
  Descent failing(options_of(GetParam(), 20, 0.1), point({1, 2}));
  Task nothing{rosenbrock, [](const Tensor&) { return true; }};
  run(failing, nothing);
  EXPECT_EQ(nothing.calls, 1);  // there is nowhere to go back to
  EXPECT_TRUE(torch::equal(failing.leaves()[0].detach(), point({1, 2})[0].detach()));
}

TEST_P(EachOptimizer, KeepsToItsBudgetAndItsPatience) {
  for (const int epochs : {1, 2, 7, 13}) {
    Descent descent(options_of(GetParam(), epochs, 0.1), point({-1.2, 1}));
    Task task{rosenbrock};
    run(descent, task);
    EXPECT_EQ(task.calls, epochs);
    EXPECT_EQ(descent.evaluations(), epochs);
  }
  DescentOptions options = options_of(GetParam(), 1000, 0.1);
  options.patience = 3;
  Descent descent(options, point({1, 1}));  // the minimum of a function that says otherwise
  Task task{[](const Tensor& x) {
    return 1 + rosenbrock(x) - rosenbrock(x).detach() + x.sum() - x.sum().detach();
  }};
  run(descent, task);
  EXPECT_EQ(task.calls, 4);  // the first one gains
}

TEST_P(EachOptimizer, AStateOfAnotherSizeOrNoStateIsRefused) {
  Descent two(options_of(GetParam(), 20, 0.1), point({1, 2}));
  Descent three(options_of(GetParam(), 20, 0.1), point({1, 2, 3}));
  EXPECT_THAT(testing::error_of([&] { two.load(three.save()); }),
              ::testing::HasSubstr("state of the optimizer: expected 2 numbers, found 3"));
  EXPECT_THAT(testing::error_of([&] { two.load("damaged"); }),
              ::testing::HasSubstr("state of the optimizer: "));
}

INSTANTIATE_TEST_SUITE_P(Methods, EachOptimizer, ::testing::Values("lbfgs", "adamw"),
                         [](const auto& info) { return std::string(info.param); });

TEST(Lbfgs, TheInheritedShapeOfTheProblemSavesEvaluations) {
  // An ill-conditioned parabola, then the same one ten times as steep.
  const Tensor curvature = torch::tensor({1.0, 30.0, 1000.0}, torch::kFloat64);
  Task gentle{[&](const Tensor& x) { return (curvature * x.square()).sum(); }};
  Task steep{[&](const Tensor&x) { return 10 * (curvature * x.square()).sum(); }}, again = steep;
  Descent first(options_of("lbfgs", 14, 0.5), point({1, 1, 1}));
  run(first, gentle);
  Descent heir(options_of("lbfgs", 6, 0.5), point({0.3, 0.2, -0.3}));
  heir.inherit(first.save());
  Descent fresh(options_of("lbfgs", 6, 0.5), point({0.3, 0.2, -0.3}));
  EXPECT_LT(run(heir, steep), 0.1 * run(fresh, again));
}

TEST(Descent, AnUnknownMethodIsRefused) {
  EXPECT_THAT(testing::error_of([] { Descent(options_of("newton", 1, 1), point({0})); }),
              ::testing::HasSubstr("expected adamw or lbfgs, found \"newton\""));
}

}  // namespace
}  // namespace uniphy
