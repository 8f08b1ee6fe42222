// The loss that Algorithm 2 descends, and its gradient.

#include "uniphy/inference/fit_problem.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "ops/base/torch.hpp"
#include "tests/support/finite_differences.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

FitOptions options_with(double prior, bool velocity = false) {
  FitOptions options;
  options.dtype = "float64";
  options.prior = prior;
  options.prior_sigma = 2;
  // The last stage of least squares moves the velocity; gradients do where there is noise.
  options.stages = {{1, 1, 1, velocity ? kLevenbergMarquardt : "lbfgs"}};
  return options;
}

std::vector<double> numbers(const Tensor& t) {
  return {t.data_ptr<double>(), t.data_ptr<double>() + t.numel()};
}

struct Setting {
  std::unique_ptr<const FitVariables> variables = make_latent_variables(testing::readable_model());
  Observation observation = testing::observe(variables->law(variables->start(1)));
  std::string name = "o";
};

TEST(FitProblem, ThePriorIsPartOfTheLossAndOfItsGradient) {
  const Setting s;
  const double weight = 0.3;
  const FitOptions without = options_with(0), with = options_with(weight);
  const FitProblem plain(s.observation, s.name, *s.variables, without);
  const FitProblem drawn(s.observation, s.name, *s.variables, with);
  const std::vector<Tensor> leaves = plain.leaves(plain.candidate(3), 0);
  const FitProblem::Evaluation a = plain.evaluate(leaves, 0);
  const Tensor slope = leaves[0].grad().clone();
  const FitProblem::Evaluation b = drawn.evaluate(leaves, 0);
  EXPECT_EQ(a.mse, b.mse);

  const std::vector<double> z = s.variables->law(leaves[0]).z;
  double square = 0;
  for (const double x : z) square += x * x;
  EXPECT_GT(square, 0);
  const double expected = weight / 4 * square;  // σ = 2
  EXPECT_NEAR((b.loss - a.loss).item<double>(), expected, 1e-13 * expected);
  EXPECT_NEAR(drawn.loss(b.mse, leaves[0]), b.loss.item<double>(), 1e-15);

  const std::vector<double> more = numbers(leaves[0].grad() - slope);
  for (std::size_t k = 0; k < z.size(); ++k) {
    std::vector<double> u = numbers(leaves[0].detach());
    u[k] += 1;
    const double spread = s.variables->law(u).z[k] - z[k];
    EXPECT_NEAR(more[k], weight / 4 * 2 * z[k] * spread, 1e-12) << k;
  }
}

TEST(FitProblem, AnalyticLawsHaveNoPrior) {
  const auto variables =
      make_analytic_variables(kernels::LawId::elastic, {{1e4, 2e4}, {1e4, 2e4}}, 2, 1);
  const Observation observation = testing::observe(testing::elastic_body());
  const std::string name = "o";
  const FitOptions with = options_with(1);
  const FitProblem problem(observation, name, *variables, with);
  const double size = 0.25;
  EXPECT_NEAR(problem.loss(1e-4, problem.candidate(0).u), 1e-4 / (size * size), 1e-12);
}

/// The gradient by the change of the initial state, against differences.
void expect_gradient_by_motion(const FitProblem& problem, const FitCandidate& c) {
  const std::vector<Tensor> leaves = problem.leaves(c, 0);
  ASSERT_EQ(leaves.size(), 2u);
  ASSERT_TRUE(std::isfinite(problem.evaluate(leaves, 0).mse));
  const std::vector<double> found = numbers(leaves[1].grad());
  const auto value = [&](const std::vector<double>& motion) {
    FitCandidate moved = c;
    moved.motion = torch::tensor(motion, torch::kFloat64);
    return problem.evaluate(problem.leaves(moved, 0), 0).loss.item<double>();
  };
  const auto expected = testing::central_differences(
      value, numbers(c.motion),
      std::vector<double>(static_cast<std::size_t>(c.motion.numel()), 1e-5));
  EXPECT_LT(testing::relative_error(found, expected), 1e-5);
}

TEST(FitProblem, GradientByTheInitialVelocity) {
  const Setting s;
  const FitOptions options = options_with(0, true);
  const FitProblem problem(s.observation, s.name, *s.variables, options);
  FitCandidate c = problem.candidate(3);
  c.motion = torch::tensor({0.2, -0.1, 0.3, 0.1, 0.4, -0.2}, torch::kFloat64);
  expect_gradient_by_motion(problem, c);
  // The same motion, said as numbers.
  const RigidMotion observed = problem.motion(problem.candidate(3)), moved = problem.motion(c);
  EXPECT_NEAR(moved.linear[2] - observed.linear[2], 0.03, 1e-12);   // units of 0.1 m/s
  EXPECT_NEAR(moved.angular[1] - observed.angular[1], 0.2, 1e-12);  // and of 0.5 rad/s
}

TEST(FitProblem, GradientByADeformedStart) {
  Setting s;
  s.observation.start_degree = 1;
  const FitOptions options = options_with(0, true);
  const FitProblem problem(s.observation, s.name, *s.variables, options);
  ASSERT_EQ(problem.motion_size(), 36);
  FitCandidate c = problem.candidate(3);
  torch::manual_seed(2);
  c.motion = 0.2 * torch::randn({36}, torch::kFloat64);
  expect_gradient_by_motion(problem, c);
}

TEST(FitProblem, TheSquaresOfTheResidualsSumToTheLoss) {
  const Setting s;
  for (const double weight : {0.0, 0.3}) {
    const FitOptions options = options_with(weight);
    const FitProblem problem(s.observation, s.name, *s.variables, options);
    const FitCandidate c = problem.candidate(3);
    const Tensor r = problem.residuals(c.u, problem.frames());
    const std::vector<Tensor> leaves = problem.leaves(c, 0);
    const double loss = problem.evaluate(leaves, 0).loss.item<double>();
    EXPECT_NEAR(r.square().sum().item<double>(), loss, 1e-12 * loss);
    EXPECT_EQ(r.numel(), s.observation.frames * s.observation.particles * 3 + (weight > 0 ? 1 : 0));
  }
  const FitOptions options = options_with(0);
  const FitProblem problem(s.observation, s.name, *s.variables, options);
  FitCandidate c = problem.candidate(0);
  c.u[0] = 50;  // far too stiff for the time step
  EXPECT_FALSE(problem.residuals(c.u, problem.frames()).defined());
}

TEST(FitProblem, APointOfLeastSquaresMayHaveTheVelocityWithIt) {
  const Setting s;
  const FitOptions options = options_with(0, true);
  const FitProblem problem(s.observation, s.name, *s.variables, options);
  FitCandidate c = problem.candidate(3);
  c.motion = torch::tensor({0.2, -0.1, 0.3, 0.1, 0.4, -0.2}, torch::kFloat64);
  const Tensor point = torch::cat({c.u, c.motion});
  const double loss = problem.evaluate(problem.leaves(c, 0), 0).loss.item<double>();
  const Tensor r = problem.residuals(point, problem.frames());
  EXPECT_NEAR(r.square().sum().item<double>(), loss, 1e-12 * loss);
  EXPECT_EQ(problem.motion_at(point).linear, problem.motion(c).linear);
  EXPECT_EQ(problem.motion_at(point).angular, problem.motion(c).angular);
}

TEST(FitProblem, WhereTheRollOutFailsTheLossIsInfiniteAndThereIsNoGradient) {
  const Setting s;
  const FitOptions options = options_with(0);
  const FitProblem problem(s.observation, s.name, *s.variables, options);
  FitCandidate c = problem.candidate(0);
  c.u[0] = 50;  // far too stiff for the time step
  const std::vector<Tensor> leaves = problem.leaves(c, 0);
  const FitProblem::Evaluation e = problem.evaluate(leaves, 0);
  EXPECT_TRUE(std::isinf(e.loss.item<double>()));
  EXPECT_TRUE(std::isinf(e.mse));
  EXPECT_FALSE(leaves[0].grad().defined());
}

}  // namespace
}  // namespace uniphy
