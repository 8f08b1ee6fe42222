// Bodies that move each other: roll-outs with companions, when bodies meet, and a code for each.

#include "uniphy/inference/several_bodies.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "ops/base/torch.hpp"
#include "tests/support/on_threads.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/data/laboratory_view.hpp"
#include "uniphy/inference/joint_fit.hpp"
#include "uniphy/inference/meeting.hpp"
#include "uniphy/inference/motion_objective.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// Two boxes that fall, one higher and faster; `aside`: how far (m) each is from the middle.
struct Pile {
  std::vector<ObservedBody> bodies;
  std::vector<kernels::LawDescription> laws;
  std::vector<InitialState> motion;

  Pile(const kernels::LawDescription& lower, const kernels::LawDescription& upper, int frames = 41,
       double aside = 0)
      : laws{lower, upper} {
    constexpr int kSide = 4, kGrid = 16, kEvery = 5;
    constexpr double kBox = 0.25, kGap = 0.05, kStep = 5e-4;
    kernels::GridSettings grid;
    grid.n = kGrid;
    grid.dt = kStep;
    std::vector<double> x, v, volume, mass;
    const double low = 0.21;  // above the floor
    for (int b = 0; b < 2; ++b) {
      RigidMotion m;
      m.centre = {0.5 + (b == 0 ? -aside : aside), low + kBox / 2 + b * (kBox + kGap), 0.5};
      m.linear = {0.2, b == 0 ? -1.0 : -3.0, 0};
      motion.push_back(InitialState(m));
      std::vector<double> own;
      for (int i = 0; i < kSide * kSide * kSide; ++i) {
        const int index[3] = {i % kSide, i / kSide % kSide, i / kSide / kSide};
        for (int k = 0; k < 3; ++k)
          own.push_back(m.centre[k] + kBox * ((index[k] + 0.5) / kSide - 0.5));
      }
      const std::vector<double> speed = m.velocities(own);
      x.insert(x.end(), own.begin(), own.end());
      v.insert(v.end(), speed.begin(), speed.end());
      bodies.push_back(
          {b == 0 ? "lower" : "upper",
           begin_observation(grid, 1000 + 200.0 * b,
                             std::vector<double>(own.size() / 3, std::pow(kBox / kSide, 3)))});
    }
    constexpr std::ptrdiff_t P = kSide * kSide * kSide;
    for (const ObservedBody& b : bodies) {
      for (const double w : b.motion.volume) {
        volume.push_back(w);
        mass.push_back(b.motion.density * w);
      }
    }
    const kernels::Rollout<double> rollout(
        grid,
        {{0, P, kernels::make_law<double>(lower)}, {P, 2 * P, kernels::make_law<double>(upper)}},
        mass, volume);
    auto state = kernels::ParticleState<double>::undeformed(x, v);
    kernels::RunOptions<double> options;
    options.every = kEvery;
    options.on_frame = [&](std::ptrdiff_t step, const kernels::ParticleState<double>& at) {
      for (int b = 0; b < 2; ++b) {
        add_frame(bodies[b].motion, double(step) * kStep,
                  {at.x.begin() + 3 * P * b, at.x.begin() + 3 * P * (b + 1)});
      }
      return true;
    };
    rollout.run(state, std::ptrdiff_t(frames - 1) * kEvery, options);
  }

  Companion companion(int b) const {
    const Observation& o = bodies[b].motion;
    return {o.start(), o.volume, o.density, laws[b], motion[b]};
  }
  std::unique_ptr<const MotionObjective> objective(const Observation& seen, int other,
                                                   const std::string& rollout = "fused") const {
    return make_motion_objective(seen, observed_steps(seen, "o"), observed_grid(seen, "o"),
                                 "float64", rollout, CloudDetail::all, {companion(other)});
  }
  Tensor velocity(int b) const {
    return torch::tensor(motion[b].velocities(bodies[b].motion.start()), torch::kFloat64)
        .view({-1, 3});
  }
};

kernels::LawDescription soft() { return testing::elastic_body(1e4, 2e4); }
kernels::LawDescription stiff() { return testing::elastic_body(4e4, 6e4); }

TEST(Companions, MoveTheBodyAsTheyDidInTheTruth) {
  const Pile pile(soft(), stiff());
  for (int b = 0; b < 2; ++b) {
    const Observation& seen = pile.bodies[b].motion;
    const auto objective = pile.objective(seen, 1 - b);
    for (const double mse : objective->frame_mse(pile.laws[b], pile.motion[b], seen.frames))
      EXPECT_LT(mse, 1e-28);
    const ops::RolloutBody body{0, seen.particles, pile.laws[b]};
    for (const char* rollout : {"fused", "stepwise"}) {
      const Tensor mse =
          pile.objective(seen, 1 - b, rollout)->mse(body, {pile.velocity(b)}, seen.frames);
      EXPECT_LT(mse.item<double>(), 1e-28) << rollout;
    }
    // Alone it moves otherwise.
    const auto alone =
        make_motion_objective(seen, observed_steps(seen, "o"), observed_grid(seen, "o"), "float64");
    EXPECT_GT(alone->frame_mse(pile.laws[b], pile.motion[b], seen.frames).back(), 1e-6);
  }
}

TEST(Companions, TrackedPointsAndTheFlowSeeThem) {
  const Pile pile(soft(), stiff());
  LaboratoryView view;
  view.share = 0.2;
  for (int b = 0; b < 2; ++b) {
    const Observation seen = laboratory_view(pile.bodies[b].motion, view);
    ASSERT_TRUE(seen.tracked());
    const auto objective = pile.objective(seen, 1 - b);
    const auto alone =
        make_motion_objective(seen, observed_steps(seen, "o"), observed_grid(seen, "o"), "float64");
    // A tracer is not its particle: it is the companion that makes the difference.
    const auto with = objective->frame_mse(pile.laws[b], pile.motion[b], seen.frames);
    const auto without = alone->frame_mse(pile.laws[b], pile.motion[b], seen.frames);
    EXPECT_LT(with.back(), 0.05 * without.back());
    const Tensor flow = objective->flow_gradients(pile.laws[b], pile.motion[b], seen.frames);
    ASSERT_EQ(flow.size(1), seen.points());
    const Tensor other = alone->flow_gradients(pile.laws[b], pile.motion[b], seen.frames);
    EXPECT_EQ((flow[0] - other[0]).abs().max().item<double>(), 0);
    EXPECT_GT((flow[-1] - other[-1]).abs().max().item<double>(), 1e-3);
  }
}

TEST(Companions, TheGradientOfALawGoesThroughThem) {
  const Pile pile(soft(), stiff());
  const Observation& seen = pile.bodies[0].motion;
  for (const char* rollout : {"fused", "stepwise"}) {
    const auto objective = pile.objective(seen, 1, rollout);
    const auto mse = [&](const Tensor& parameters) {
      return objective->mse({0, seen.particles, soft(), parameters}, {pile.velocity(0)}, 30);
    };
    const Tensor at = torch::tensor({1.5e4, 1.5e4}, torch::kFloat64).requires_grad_();
    mse(at).backward();
    for (int k = 0; k < 2; ++k) {
      const auto along = [&](double step) {
        Tensor moved = at.detach().clone();
        moved[k] += step;
        return mse(moved).item<double>();
      };
      constexpr double kStep = 1;
      const double difference = (along(kStep) - along(-kStep)) / (2 * kStep);
      EXPECT_NEAR(at.grad()[k].item<double>(), difference, 1e-5 * std::abs(difference)) << rollout;
    }
  }
}

TEST(Meeting, IsTheFirstFrameWithNodesInCommon) {
  kernels::GridSettings grid;
  grid.n = 20;
  BodyPath a{3, {}}, b{3, {}};
  for (int f = 0; f < 3; ++f) {
    a.x.insert(a.x.end(), {0.3, 0.5, 0.5});
    b.x.insert(b.x.end(), {0.6 - 0.09 * f, 0.5, 0.5});
  }
  // Stencils reach 1.5 cells of 0.05 m each way.
  EXPECT_EQ(first_meeting(a, b, grid), 2);
  b.x[6] = std::nan("");  // not seen there
  EXPECT_EQ(first_meeting(a, b, grid), -1);
  EXPECT_EQ(first_meeting(a, {}, grid), -1);
}

TEST(Meeting, GroupsAreOfAllThatAreConnected) {
  std::vector<std::vector<bool>> meets(5, std::vector<bool>(5));
  const auto meet = [&](int a, int b) { meets[a][b] = meets[b][a] = true; };
  meet(0, 3);
  meet(3, 4);
  EXPECT_EQ(meeting_groups(meets), (std::vector<int>{0, 1, 2, 0, 0}));
}

FitOptions schedule() {
  FitOptions options;
  options.stages = {{0.3, 4, 5}, {1, 2, 12}};
  return options;
}

FitHooks quiet() {
  FitHooks hooks;
  hooks.progress = false;
  return hooks;
}

AdaptationOptions code_alone() {
  AdaptationOptions options;
  options.rungs = {Rung::latent};
  options.samples = 0;
  return options;
}

struct Fits {
  ModelFile model = testing::readable_model();
  std::unique_ptr<const FitVariables> variables = make_latent_variables(model);

  kernels::LawDescription law(int start) const { return variables->law(variables->start(start)); }
  BodiesInference fit(const std::vector<ObservedBody>& bodies, const FitHooks& hooks) const {
    return infer_bodies(bodies, "o", *variables, schedule(), hooks, code_alone());
  }
};

TEST(SeveralBodies, EachOfTwoThatTouchGetsItsCode) {
  const Fits fits;
  const Pile pile(fits.law(2), fits.law(5));
  const BodiesInference found = fits.fit(pile.bodies, quiet());
  EXPECT_EQ(found.group, (std::vector<int>{0, 0}));
  for (int b = 0; b < 2; ++b) {
    const Inference& body = found.bodies[b];
    EXPECT_LT(std::sqrt(body.fit_mse) / body.size, 1e-3) << b;
    EXPECT_GE(found.rounds[b], 2);
    EXPECT_LT(body.fit.contact, 40);
  }
  // By itself, no law explains what the other one does to it.
  const Inference alone =
      infer(pile.bodies[1].motion, "o", *fits.variables, schedule(), quiet(), code_alone());
  EXPECT_GT(std::sqrt(alone.fit_mse) / alone.size, 5e-3);
}

TEST(SeveralBodies, TheyMayBeTrackedPoints) {
  const Fits fits;
  const Pile pile(fits.law(2), fits.law(5));
  LaboratoryView view;
  view.share = 0.3;
  view.stride = 2;
  std::vector<ObservedBody> seen;
  for (const ObservedBody& b : pile.bodies)
    seen.push_back({b.name, laboratory_view(b.motion, view)});
  const BodiesInference found = fits.fit(seen, quiet());
  EXPECT_EQ(found.group, (std::vector<int>{0, 0}));
  for (const Inference& body : found.bodies) {
    EXPECT_TRUE(body.seen.tracked());
    EXPECT_LT(std::sqrt(body.fit_mse) / body.size, 3e-3);  // a tracer is not its particle
  }
}

TEST(SeveralBodies, OnesThatNeverMeetAreFittedEachForItself) {
  const Fits fits;
  const Pile pile(fits.law(2), fits.law(5), 41, 0.22);
  const BodiesInference found = fits.fit(pile.bodies, quiet());
  EXPECT_EQ(found.group, (std::vector<int>{0, 1}));
  EXPECT_EQ(found.rounds, (std::vector<int>{1, 1}));
  for (int b = 0; b < 2; ++b) {
    const Inference alone =
        infer(pile.bodies[b].motion, "o", *fits.variables, schedule(), quiet(), code_alone());
    EXPECT_EQ(alone.fit.u, found.bodies[b].fit.u);
    EXPECT_EQ(alone.fit_mse, found.bodies[b].fit_mse);
  }
}

TEST(SeveralBodies, ResumesToTheSameBitsOnAnyNumberOfThreads) {
  const Fits fits;
  const Pile pile(fits.law(2), fits.law(5), 21);
  const auto whole = testing::on_threads(1, [&] { return fits.fit(pile.bodies, quiet()); });
  const testing::Scratch scratch;
  FitHooks hooks = quiet();
  hooks.state_file = scratch.file("state.h5");
  hooks.fingerprint = "f";
  hooks.save_seconds = 0;
  int left = 60;
  hooks.on_record = [&](const FitRecord&) {
    if (--left == 0) throw std::runtime_error("killed");
  };
  EXPECT_THROW(fits.fit(pile.bodies, hooks), std::runtime_error);
  hooks.on_record = nullptr;
  const auto resumed = testing::on_threads(2, [&] { return fits.fit(pile.bodies, hooks); });
  for (int b = 0; b < 2; ++b) {
    EXPECT_EQ(resumed.bodies[b].fit.u, whole.bodies[b].fit.u);
    EXPECT_EQ(resumed.bodies[b].fitted.x, whole.bodies[b].fitted.x);
  }
  EXPECT_FALSE(resumed.state_files.empty());
}

TEST(SeveralBodies, TheMarginalOfAPosteriorIsThatOfItsBlock) {
  // Two codes of two numbers and a velocity of one number each: u₁ and u₃ go together.
  FitPosterior all;
  const double c = std::sqrt(0.5);
  all.spread = {0.1, 0.2, 0.3, 0.9};
  all.directions = Eigen::MatrixXd::Zero(4, 4);
  all.directions(0, 0) = all.directions(2, 0) = c;  // 0.1 along (1, 0, 1, 0)/√2
  all.directions(1, 1) = 1;
  all.directions(3, 2) = 1;
  all.directions(0, 3) = c;
  all.directions(2, 3) = -c;
  all.samples = {torch::arange(6, torch::kFloat64)};
  const FitPosterior second = marginal_of(all, 2, 2, 5, 1);
  ASSERT_EQ(second.spread.size(), 2u);
  EXPECT_NEAR(second.spread[0], 0.3, 1e-12);
  EXPECT_NEAR(second.spread[1], std::sqrt(0.5 * (0.01 + 0.81)), 1e-12);
  EXPECT_EQ(second.determined, 1);
  EXPECT_TRUE(torch::equal(second.samples[0], torch::tensor({2.0, 3.0, 5.0}, torch::kFloat64)));
}

}  // namespace
}  // namespace uniphy
