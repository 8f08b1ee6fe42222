#include "uniphy/inference/motion_objective.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/finite_differences.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "uniphy/inference/fit_variables.hpp"

namespace uniphy {
namespace {

struct Problem {
  Observation observation;
  ObservedSteps steps;
  kernels::GridSettings grid;
  RigidMotion motion;
  std::unique_ptr<const MotionObjective> objective;

  explicit Problem(const kernels::LawDescription& law, const std::string& dtype = "float64")
      : observation(testing::observe(law)),
        steps(observed_steps(observation, "o")),
        grid(observed_grid(observation, "o")),
        motion(testing::ObservedScene{}.motion),
        objective(make_motion_objective(observation, steps, grid, dtype)) {}
};

TEST(MotionObjective, IsZeroAtTheTruth) {
  const Problem p(testing::elastic_body());
  const Evaluation e = p.objective->evaluate(testing::elastic_body(), p.motion, 41);
  EXPECT_LT(e.mse, 1e-24);
  const Problem single(testing::elastic_body(), "float32");
  EXPECT_LT(single.objective->evaluate(testing::elastic_body(), p.motion, 41).mse, 1e-10);
}

TEST(MotionObjective, EvaluateAndFrameMseAgree) {
  const Problem p(testing::elastic_body());
  const auto law = testing::elastic_body(3e4, 2e4);
  const auto frames = p.objective->frame_mse(law, p.motion, 41);
  EXPECT_EQ(frames[0], 0);
  for (const std::ptrdiff_t n : {15, 41}) {
    const double mse = p.objective->evaluate(law, p.motion, n).mse;
    EXPECT_GT(mse, 0);
    EXPECT_NEAR(mean_of_first(frames, n), mse, 1e-9 * mse);
  }
}

TEST(MotionObjective, GradientOfAnalyticParametersAndOfTheVelocity) {
  const Problem p(testing::elastic_body());
  RigidMotion moved = p.motion;
  moved.linear += Eigen::Vector3d(0.02, 0.01, -0.03);
  const Evaluation e = p.objective->evaluate(testing::elastic_body(2.4e4, 2.5e4), moved, 30);
  const auto value = [&](const std::vector<double>& w) {
    RigidMotion m = moved;
    for (int k = 0; k < 3; ++k) {
      m.linear[k] = w[2 + k];
      m.angular[k] = w[5 + k];
    }
    return p.objective->evaluate(testing::elastic_body(w[0], w[1]), m, 30).mse;
  };
  std::vector<double> at{2.4e4, 2.5e4}, steps{2, 2};
  std::vector<double> gradient = e.parameters;
  for (int k = 0; k < 6; ++k) {
    at.push_back(k < 3 ? moved.linear[k] : moved.angular[k - 3]);
    steps.push_back(1e-5);
    gradient.push_back(e.motion[k]);
  }
  const auto expected = testing::central_differences(value, at, steps);
  for (std::size_t k = 0; k < at.size(); ++k) {
    EXPECT_NEAR(gradient[k], expected[k], 1e-6 * std::abs(expected[k])) << k;
  }
}

TEST(MotionObjective, GradientOfTheLatentCodeThroughTheFitVariables) {
  const auto variables = make_latent_variables(testing::readable_model());
  const std::vector<double> truth = variables->start(1);
  const Problem p(variables->law(truth));
  std::vector<double> u = truth;
  for (double& x : u) x += 0.2;
  const Evaluation e = p.objective->evaluate(variables->law(u), p.motion, 41);
  const auto gradient = variables->gradient(u, e.parameters);
  const auto value = [&](const std::vector<double>& w) {
    return p.objective->evaluate(variables->law(w), p.motion, 41).mse;
  };
  // Steps small enough that few particles change sides of their yield surface.
  const auto expected = testing::central_differences(value, u, std::vector<double>(u.size(), 1e-6));
  EXPECT_LT(testing::relative_error(gradient, expected), 1e-4);
}

TEST(MotionObjective, ARollOutThatFailsIsInfinite) {
  const Problem p(testing::elastic_body());
  const auto stiff = testing::elastic_body(1e9, 1e9);  // far beyond the time step
  const Evaluation e = p.objective->evaluate(stiff, p.motion, 41);
  EXPECT_TRUE(std::isinf(e.mse));
  const auto frames = p.objective->frame_mse(stiff, p.motion, 41);
  EXPECT_EQ(frames[0], 0);
  EXPECT_TRUE(std::isinf(frames[40]));
}

}  // namespace
}  // namespace uniphy
