#include "uniphy/inference/motion_objective.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "ops/base/torch.hpp"
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
  InitialState motion;
  std::unique_ptr<const MotionObjective> objective;

  explicit Problem(const kernels::LawDescription& law, const std::string& dtype = "float64",
                   const std::string& rollout = "fused")
      : observation(testing::observe(law)),
        steps(observed_steps(observation, "o")),
        grid(observed_grid(observation, "o")),
        motion(InitialState(testing::ObservedScene{}.motion)),
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
    return objective->mse(body(law), {velocities()}, frames).item<double>();
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
  const double found = objective->mse(p.body(law), {p.velocities()}, 5).item<double>();
  EXPECT_GT(found, 0);
  EXPECT_NEAR(found, expected, 1e-12 * expected);
}

TEST(MotionObjective, ATimeBetweenTwoStepsLiesOnTheLineBetweenTheirPositions) {
  Problem p(testing::elastic_body());
  const Observation& o = p.observation;
  Observation some = o;
  some.frames = 4;
  some.time = {0, o.time[10] + 0.25 * o.dt, o.time[10] + 0.75 * o.dt, o.time[20]};
  some.x.resize(4 * 3 * o.particles);
  const auto objective = make_motion_objective(some, observed_steps(some, "o"), p.grid, "float64");
  const auto law = testing::elastic_body(3e4, 2e4);
  std::vector<std::vector<double>> x;
  objective->simulate(law, p.motion, [&](std::ptrdiff_t, const auto& at) { x.push_back(at); });
  ASSERT_EQ(x.size(), 4u);
  Observation every = o;  // the state of every step
  every.frames = 13;
  every.time.clear();
  for (int s = 0; s < 13; ++s) every.time.push_back((s == 0 ? 0 : 39 + s) * o.dt);
  every.x.resize(13 * 3 * o.particles);
  const auto fine = make_motion_objective(every, observed_steps(every, "o"), p.grid, "float64");
  std::vector<std::vector<double>> states;
  fine->simulate(law, p.motion, [&](std::ptrdiff_t, const auto& at) { states.push_back(at); });
  for (std::size_t k = 0; k < x[1].size(); ++k) {  // frame 10 is step 50, state 11
    EXPECT_NEAR(x[1][k], 0.75 * states[11][k] + 0.25 * states[12][k], 1e-14);
    EXPECT_NEAR(x[2][k], 0.25 * states[11][k] + 0.75 * states[12][k], 1e-14);
  }
  // The tensor of the op is the same.
  const Tensor r = objective->residuals(p.body(law), {p.velocities()}, 4);
  for (int f = 1; f < 4; ++f) {
    const Tensor found = r[f] + to_tensor({some.positions(f), some.positions(f) + x[f].size()});
    EXPECT_LE((found - to_tensor(x[f])).abs().max().item<double>(), 1e-14) << f;
  }
}

/// Every fifth particle as a tracked point.
Observation tracked(const Observation& whole) {
  Observation o = whole;
  o.body = whole.start();
  o.x.clear();
  for (std::int64_t f = 0; f < o.frames; ++f) {
    for (std::int64_t p = 0; p < whole.particles; p += 5)
      o.x.insert(o.x.end(), whole.positions(f) + 3 * p, whole.positions(f) + 3 * p + 3);
  }
  const auto row = static_cast<std::ptrdiff_t>(o.x.size()) / o.frames;
  o.tracers.assign(o.x.begin(), o.x.begin() + row);
  return o;
}

TEST(MotionObjective, TrackedPointsFollowTheBody) {
  const Problem p(testing::elastic_body());
  Observation points = tracked(p.observation);
  const auto objective = [&] { return make_motion_objective(points, p.steps, p.grid, "float64"); };
  const Tensor all = torch::cat({p.velocities(), torch::zeros({points.points(), 3})});
  const auto mse = [&](const kernels::LawDescription& law) {
    return objective()->mse(p.body(law), {all}, 41).item<double>();
  };
  EXPECT_LT(mse(testing::elastic_body()), 1e-28);
  const auto law = testing::elastic_body(3e4, 2e4);
  const double seen = mse(law);
  EXPECT_NEAR(mean_of_first(objective()->frame_mse(law, p.motion, 41), 41), seen, 1e-12 * seen);
  // What is hidden counts nowhere, and the mean is over what is left.
  std::vector<double> square(41 * points.points());
  const Tensor r = objective()->residuals(p.body(law), {all}, 41);
  double expected = 0, count = 0;
  for (std::int64_t f = 0; f < 41; ++f) {
    for (std::int64_t q = 0; q < points.points(); ++q) {
      if ((f + q) % 3 == 1) {
        for (int k = 0; k < 3; ++k) points.x[3 * (f * points.points() + q) + k] = std::nan("");
        continue;
      }
      expected += r[f].slice(0, 3 * q, 3 * q + 3).square().sum().item<double>();
      count += 3;
    }
  }
  EXPECT_NEAR(mse(law), expected / count, 1e-12 * expected / count);
  EXPECT_NEAR(mean_of_first(objective()->frame_mse(law, p.motion, 41), 41), expected / count,
              1e-12 * expected / count);
}

TEST(MotionObjective, TrackedPointsStepByStepAreTheSame) {
  const Problem p(testing::elastic_body());
  const Observation points = tracked(p.observation);
  const auto law = testing::elastic_body(3e4, 2e4);
  const Tensor start = torch::cat({p.velocities(), torch::zeros({points.points(), 3})});
  std::vector<Tensor> found;
  for (const char* rollout : {"fused", "stepwise"}) {
    const Tensor v = start.clone().requires_grad_();
    make_motion_objective(points, p.steps, p.grid, "float64", rollout)
        ->mse(p.body(law), {v}, 20)
        .backward();
    found.push_back(v.grad());
  }
  EXPECT_GT(found[0].norm().item<double>(), 0);
  EXPECT_LE(((found[0] - found[1]).norm() / found[0].norm()).item<double>(), 1e-9);
}

TEST(MotionObjective, FlowGradientsSayHowAStartMovesThePath) {
  const Problem p(testing::elastic_body());
  Observation points = tracked(p.observation);
  const auto law = testing::elastic_body();
  const auto paths = [&] {
    std::vector<double> x;
    make_motion_objective(points, p.steps, p.grid, "float64")
        ->simulate(law, p.motion, [&](std::ptrdiff_t, const std::vector<double>& at) {
          x.insert(x.end(), at.begin(), at.end());
        });
    return to_tensor(x).view({41, -1, 3});
  };
  const Tensor G =
      make_motion_objective(points, p.steps, p.grid, "float64")->flow_gradients(law, p.motion, 41);
  EXPECT_TRUE(torch::equal(G[0][0], torch::eye(3, torch::kFloat64)));
  const Tensor before = paths();
  constexpr double kStep = 1e-5;
  for (std::size_t k = 1; k < points.tracers.size(); k += 3) points.tracers[k] += kStep;
  const Tensor expected = (paths() - before) / kStep, found = G.select(3, 1);
  // The affine velocity C is a mean over the kernel of the slope that moves the point.
  EXPECT_LE(((found - expected).norm() / expected.norm()).item<double>(), 0.05);
  EXPECT_GE((expected[40] - expected[0]).norm().item<double>(), 1);
}

/// Relative difference of a gradient from central differences.
double gradient_error(const Problem& p, const Tensor& parameters,
                      const kernels::LawDescription& law, const std::vector<double>& steps,
                      std::ptrdiff_t frames) {
  const Tensor leaf = parameters.clone().requires_grad_();
  p.objective->mse(p.body(law, leaf), {p.velocities()}, frames).backward();
  const auto value = [&](const std::vector<double>& w) {
    return p.objective->mse(p.body(law, to_tensor(w)), {p.velocities()}, frames).item<double>();
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
  p.objective->mse(p.body(law), {v}, 30).backward();
  torch::manual_seed(5);
  const Tensor direction = torch::randn_like(v);
  const auto value = [&](const std::vector<double>& t) {
    return p.objective->mse(p.body(law), {v.detach() + t[0] * direction}, 30).item<double>();
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
    return p.objective->mse(variables->body(at, p.observation.particles), {p.velocities()}, 41);
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
