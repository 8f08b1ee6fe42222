#include "uniphy/inference/motion_objective.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/torch.h>

#include <cmath>

#include "tests/support/finite_differences.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/inference/fit_variables.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

Tensor to_tensor(const std::vector<double>& numbers) {
  return torch::tensor(numbers, torch::kFloat64);
}

struct Problem {
  Observation observation;
  ObservedSteps steps;
  kernels::GridSettings grid;
  RigidMotion motion;
  std::unique_ptr<const MotionObjective> objective;

  explicit Problem(const kernels::LawDescription& law, const std::string& dtype = "float64",
                   const std::string& rollout = "fused")
      : observation(testing::observe(law)),
        steps(observed_steps(observation, "o")),
        grid(observed_grid(observation, "o")),
        motion(testing::ObservedScene{}.motion),
        objective(make_motion_objective(observation, steps, grid, dtype, rollout)) {}

  Tensor velocities() const {
    return to_tensor(motion.velocities({observation.x.begin(),
                                        observation.x.begin() + 3 * observation.particles}))
        .view({-1, 3});
  }
  ops::RolloutBody body(const kernels::LawDescription& law, const Tensor& parameters = {}) const {
    return {0, observation.particles, law, parameters};
  }
  double mse(const kernels::LawDescription& law, std::ptrdiff_t frames) const {
    return objective->mse(body(law), velocities(), frames).item<double>();
  }
};

TEST(MotionObjective, IsZeroAtTheTruth) {
  const Problem p(testing::elastic_body());
  EXPECT_LT(p.mse(testing::elastic_body(), 41), 1e-30);
  const Problem single(testing::elastic_body(), "float32");
  EXPECT_LT(single.mse(testing::elastic_body(), 41), 1e-12);  // of a body of 0.3 m
}

TEST(MotionObjective, MseAndFrameMseAgree) {
  const Problem p(testing::elastic_body());
  const auto law = testing::elastic_body(3e4, 2e4);
  const auto frames = p.objective->frame_mse(law, p.motion, 41);
  EXPECT_EQ(frames[0], 0);
  for (const std::ptrdiff_t n : {15, 41}) {
    const double mse = p.mse(law, n);
    EXPECT_GT(mse, 0);
    EXPECT_NEAR(mean_of_first(frames, n), mse, 1e-13 * mse);
  }
}

TEST(MotionObjective, UnevenFramesAreComparedWithTheirOwnStates) {
  Problem p(testing::elastic_body());
  Observation& o = p.observation;
  const std::vector<std::ptrdiff_t> kept{0, 3, 4, 10, 11};
  Observation some = o;
  some.x.clear();
  some.time.clear();
  for (const std::ptrdiff_t f : kept) {
    some.x.insert(some.x.end(), o.positions(f), o.positions(f) + 3 * o.particles);
    some.time.push_back(o.time[f]);
  }
  some.frames = 5;
  const auto objective = make_motion_objective(some, observed_steps(some, "o"), p.grid, "float64");
  const auto law = testing::elastic_body(3e4, 2e4);
  const auto all = p.objective->frame_mse(law, p.motion, 41);
  double expected = 0;
  for (const std::ptrdiff_t f : kept) expected += all[f] / 5;
  const double found = objective->mse(p.body(law), p.velocities(), 5).item<double>();
  EXPECT_GT(found, 0);
  EXPECT_NEAR(found, expected, 1e-12 * expected);
}

/// Relative difference of a gradient from central differences.
double gradient_error(const Problem& p, const Tensor& parameters,
                      const kernels::LawDescription& law, const std::vector<double>& steps,
                      std::ptrdiff_t frames) {
  const Tensor leaf = parameters.clone().requires_grad_();
  p.objective->mse(p.body(law, leaf), p.velocities(), frames).backward();
  const auto value = [&](const std::vector<double>& w) {
    return p.objective->mse(p.body(law, to_tensor(w)), p.velocities(), frames).item<double>();
  };
  const std::vector<double> at(leaf.data_ptr<double>(), leaf.data_ptr<double>() + leaf.numel());
  const auto expected = testing::central_differences(value, at, steps);
  const double* g = leaf.grad().data_ptr<double>();
  return testing::relative_error({g, g + leaf.numel()}, expected);
}

class EachRollout : public ::testing::TestWithParam<const char*> {};

TEST_P(EachRollout, GradientOfAnalyticParametersAndOfTheVelocity) {
  const Problem p(testing::elastic_body(), "float64", GetParam());
  EXPECT_LT(gradient_error(p, to_tensor({2.4e4, 2.5e4}), testing::elastic_body(), {2, 2}, 30),
            1e-7);
  const Tensor v = p.velocities().requires_grad_();
  const auto law = testing::elastic_body(2.4e4, 2.5e4);
  p.objective->mse(p.body(law), v, 30).backward();
  torch::manual_seed(5);
  const Tensor direction = torch::randn_like(v);
  const auto value = [&](const std::vector<double>& t) {
    return p.objective->mse(p.body(law), v.detach() + t[0] * direction, 30).item<double>();
  };
  const double found = (direction * v.grad()).sum().item<double>();
  const double expected = testing::central_differences(value, {0}, {1e-5})[0];
  EXPECT_NEAR(found, expected, 1e-7 * std::abs(expected));
}

INSTANTIATE_TEST_SUITE_P(Rollouts, EachRollout, ::testing::Values("fused", "stepwise"),
                         [](const auto& info) { return std::string(info.param); });

TEST(MotionObjective, GradientOfTheLatentCodeThroughTheFitVariables) {
  const auto variables = make_latent_variables(testing::readable_model());
  const std::vector<double> truth = variables->start(1);
  const Problem p(variables->law(truth));
  std::vector<double> u = truth;
  for (double& x : u) x += 0.2;
  const auto mse = [&](const Tensor& at) {
    return p.objective->mse(variables->body(at, p.observation.particles), p.velocities(), 41);
  };
  const Tensor leaf = to_tensor(u).requires_grad_();
  mse(leaf).backward();
  const auto value = [&](const std::vector<double>& w) { return mse(to_tensor(w)).item<double>(); };
  // Steps small enough that few particles change sides of their yield surface.
  const auto expected = testing::central_differences(value, u, std::vector<double>(u.size(), 1e-6));
  const double* g = leaf.grad().data_ptr<double>();
  EXPECT_LT(testing::relative_error({g, g + leaf.numel()}, expected), 1e-5);
}

TEST(MotionObjective, ARollOutThatFailsIsAnErrorAndInfiniteFrames) {
  const auto stiff = testing::elastic_body(1e9, 1e9);  // far beyond the time step
  for (const char* rollout : {"fused", "stepwise"}) {
    const Problem p(testing::elastic_body(), "float64", rollout);
    const std::string message = testing::error_of([&] { p.mse(stiff, 41); });
    EXPECT_THAT(message, ::testing::HasSubstr("particle"));
    EXPECT_THAT(message, ::testing::HasSubstr("step"));
    const auto frames = p.objective->frame_mse(stiff, p.motion, 41);
    EXPECT_EQ(frames[0], 0);
    EXPECT_TRUE(std::isinf(frames[40]));
  }
}

}  // namespace
}  // namespace uniphy
