#include "ops/kernels/rollout/rollout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "tests/ops/kernels/rollout/two_bodies.hpp"
#include "tests/support/error_of.hpp"

namespace uniphy::kernels {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

template <class T>
class RolloutOfType : public ::testing::Test {};
using Types = ::testing::Types<float, double>;
TYPED_TEST_SUITE(RolloutOfType, Types);

TYPED_TEST(RolloutOfType, SameBitsOnAnyNumberOfThreads) {
  using T = TypeParam;
  TwoBodies<T> scene(1500);
  const int before = omp_get_max_threads();
  const auto once = [&](int threads) {
    omp_set_num_threads(threads);
    RolloutGradient<T> g;
    const double loss = Loss<T>{40, 5}(scene.rollout(), scene.state, &g);
    ParticleState<T> state = scene.state;
    scene.rollout().run(state, 40);
    return std::make_tuple(loss, g.state.x, g.state.v, g.state.C, g.state.F, g.parameters, state.x,
                           state.F);
  };
  const auto one = once(1);
  EXPECT_EQ(one, once(2));
  EXPECT_EQ(one, once(3));
  omp_set_num_threads(before);
}

TYPED_TEST(RolloutOfType, FramesAndSamplesDoNotChangeTheRun) {
  using T = TypeParam;
  TwoBodies<T> scene(300);
  const Rollout<T> rollout = scene.rollout();
  ParticleState<T> plain = scene.state, watched = scene.state;
  rollout.run(plain, 70);

  RunOptions<T> options;
  std::vector<std::ptrdiff_t> frames, samples;
  ParticleState<T> before;
  options.every = 3;
  options.first_step = 100;
  options.frame_v = options.frame_C = options.frame_F = true;
  options.on_frame = [&](std::ptrdiff_t step, const ParticleState<T>& state) {
    frames.push_back(step);
    before = state;
    return true;
  };
  options.sample_step = [](std::ptrdiff_t step) { return step % 9 == 1; };  // right after a frame
  options.on_sample = [&](std::ptrdiff_t step, const LawSample<T>& sample) {
    samples.push_back(step);
    EXPECT_EQ(sample.C, before.C);
    for (std::ptrdiff_t p = 0; p < 300; ++p) {  // F_trial = (I + Δt C) F
      for (int k = 0; k < 9; ++k) {
        const int a = k / 3, b = k % 3;
        T expected = before.F[9 * p + k];
        for (int c = 0; c < 3; ++c) {
          expected += T(scene.grid.dt) * before.C[9 * p + 3 * a + c] * before.F[9 * p + 3 * c + b];
        }
        EXPECT_NEAR(sample.F_trial[9 * p + k], expected, 4 * std::numeric_limits<T>::epsilon());
      }
    }
    // The law again, on what the sample says that it saw.
    std::vector<T> F(sample.F_trial.size()), tau(F.size());
    for (const auto& body : rollout.bodies()) {
      const std::ptrdiff_t at = 9 * body.begin;
      body.law->evaluate(body.end - body.begin, T(scene.grid.dt), {&sample.F_trial[at], 9, 1},
                         {&sample.C[at], 9, 1}, {&F[at], 9, 1}, {&tau[at], 9, 1});
    }
    EXPECT_EQ(F, sample.F_proj);
    EXPECT_EQ(tau, sample.tau);
  };
  EXPECT_EQ(rollout.run(watched, 70, options), 70);
  EXPECT_EQ(plain.x, watched.x);
  EXPECT_EQ(plain.v, watched.v);
  EXPECT_EQ(plain.C, watched.C);
  EXPECT_EQ(plain.F, watched.F);
  ASSERT_EQ(frames.size(), 24u);
  EXPECT_EQ(frames.front(), 100);
  EXPECT_EQ(frames.back(), 169);
  EXPECT_EQ(samples, (std::vector<std::ptrdiff_t>{100, 109, 118, 127, 136, 145, 154, 163}));
}

// Wherever it is cut, whether or not the particles have just been sorted.
TYPED_TEST(RolloutOfType, GoesOnToTheSameBits) {
  using T = TypeParam;
  TwoBodies<T> scene(300);
  scene.chi = 1e4;
  const Rollout<T> rollout = scene.rollout();
  ParticleState<T> whole = scene.state;
  rollout.run(whole, 100);
  for (const std::vector<int>& parts :
       {std::vector<int>{32, 68}, {13, 87}, {31, 1, 68}, {40, 50, 10}, {0, 1, 0, 99}}) {
    ParticleState<T> state = scene.state;
    RunOptions<T> options;
    SortState<T> sort;
    options.sort = &sort;
    for (const int steps : parts) rollout.run(state, steps, options);
    EXPECT_EQ(state.x, whole.x);
    EXPECT_EQ(state.v, whole.v);
    EXPECT_EQ(state.C, whole.C);
    EXPECT_EQ(state.F, whole.F);
    EXPECT_EQ(state.memory, whole.memory);
    EXPECT_EQ(sort.steps, 4);
  }
  ParticleState<T> state = scene.state;
  RunOptions<T> options;
  SortState<T> sort{5, {}};
  options.sort = &sort;
  EXPECT_THAT(testing::error_of([&] { rollout.run(state, 1, options); }),
              HasSubstr("expected 900 numbers in sort, found 0"));
}

// What the law remembers goes along when particles are sorted again, and stays with its body; a
// state without memory begins at 0, and one that is handed on goes on to the same bits.
TYPED_TEST(RolloutOfType, CarriesTheMemoryOfALaw) {
  using T = TypeParam;
  TwoBodies<T> scene(300);
  scene.chi = 1e4;
  const Rollout<T> rollout = scene.rollout();
  EXPECT_TRUE(rollout.has_memory());
  ParticleState<T> whole = scene.state, parts = scene.state, zero = scene.state;
  rollout.run(whole, 96);
  ASSERT_EQ(whole.memory.size(), 300u);
  for (int p = 0; p < 100; ++p) EXPECT_EQ(whole.memory[p], T(0));
  for (int p = 100; p < 300; ++p) EXPECT_GT(whole.memory[p], T(2));  // towards tr F
  zero.memory.assign(300, T(0));
  rollout.run(zero, 96);
  EXPECT_EQ(zero.memory, whole.memory);
  EXPECT_EQ(zero.x, whole.x);
  rollout.run(parts, 32);
  rollout.run(parts, 64);
  EXPECT_EQ(parts.memory, whole.memory);
  EXPECT_EQ(parts.x, whole.x);
  // It matters.
  ParticleState<T> forgetful = scene.state;
  rollout.run(forgetful, 32);
  forgetful.memory.clear();
  rollout.run(forgetful, 64);
  EXPECT_NE(forgetful.x, whole.x);

  ParticleState<T> bad = scene.state;
  bad.memory.assign(7, T(0));
  EXPECT_THAT(testing::error_of([&] { rollout.run(bad, 1); }),
              HasSubstr("expected 300 numbers in memory, found 7"));
}

TYPED_TEST(RolloutOfType, RecordsTheFramesOfTheRun) {
  using T = TypeParam;
  TwoBodies<T> scene(200);
  const Rollout<T> rollout = scene.rollout();
  std::vector<T> recorded(3 * 200 * 9), seen;
  rollout.record(scene.state, 80, 10, recorded.data(), nullptr, nullptr);
  RunOptions<T> options;
  options.every = 10;
  options.on_frame = [&](std::ptrdiff_t, const ParticleState<T>& state) {
    seen.insert(seen.end(), state.x.begin(), state.x.end());
    return true;
  };
  ParticleState<T> state = scene.state;
  rollout.run(state, 80, options);
  EXPECT_EQ(recorded, seen);
}

TEST(Rollout, StopsWhenToldTo) {
  TwoBodies<double> scene(50);
  RunOptions<double> options;
  options.every = 4;
  options.on_frame = [](std::ptrdiff_t step, const auto&) { return step < 12; };
  ParticleState<double> stopped = scene.state, same = scene.state;
  EXPECT_EQ(scene.rollout().run(stopped, 100, options), 12);
  scene.rollout().run(same, 12);
  EXPECT_EQ(stopped.x, same.x);
}

TEST(Rollout, FreeFlightIsExact) {
  // One particle of vanishing stiffness, away from the walls: x = x0 + v0 t + g t (t + Δt)/2, the
  // sum of the explicit steps.
  GridSettings grid;
  grid.dt = 1e-3;
  const Rollout<double> rollout(grid, {{0, 1, std::make_shared<SimpleLaw<double>>(1e-9, 1e-9)}},
                                {1e-3}, {1e-6});
  auto state = ParticleState<double>::undeformed({0.31, 0.62, 0.47}, {0.5, 0.3, -0.2});
  rollout.run(state, 200);
  const double t = 0.2, v0[3] = {0.5, 0.3, -0.2}, x0[3] = {0.31, 0.62, 0.47};
  for (int a = 0; a < 3; ++a) {
    const double g = grid.gravity[a];
    EXPECT_NEAR(state.x[a], x0[a] + v0[a] * t + g * t * (t + grid.dt) / 2, 1e-12);
    EXPECT_NEAR(state.v[a], v0[a] + g * t, 1e-12);
  }
}

TEST(Rollout, ErrorsNameTheParticleTheStepAndTheCause) {
  GridSettings grid;
  const auto law = std::make_shared<SimpleLaw<double>>(1e-6, 1e-6);
  const auto message = [&](std::vector<double> x, std::vector<double> v, double dt,
                           std::vector<double> F = {}) -> std::string {
    grid.dt = dt;
    const std::ptrdiff_t n = std::ptrdiff_t(x.size() / 3);
    const Rollout<double> rollout(grid, {{0, n, law}}, std::vector<double>(n, 1e-3),
                                  std::vector<double>(n, 1e-6));
    auto state = ParticleState<double>::undeformed(x, v);
    if (!F.empty()) state.F = F;
    try {
      rollout.run(state, 100);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  EXPECT_THAT(message({0.5, 0.5, 0.5, 0.01, 0.5, 0.5}, std::vector<double>(6, 0), 1e-4),
              AllOf(HasSubstr("particle 1 at (0.01, 0.5, 0.5)"), HasSubstr("after step 0"),
                    HasSubstr("placed too close")));
  grid.bound = 0;
  EXPECT_THAT(message({0.5, 0.5, 0.5}, {2, 0, 0}, 5e-3),
              AllOf(HasSubstr("particle 0 at (0.93, "), HasSubstr("after step 43"),
                    HasSubstr("too close to the border")));
  EXPECT_THAT(message({0.5, 0.5, 0.5}, {50, 0, 0}, 1e-2),
              AllOf(HasSubstr("after step 1"), HasSubstr("time step is too large")));
  const double nan = std::nan("");
  EXPECT_THAT(message({0.5, 0.5, 0.5}, {0, nan, 0}, 1e-4),
              AllOf(HasSubstr("is not finite"), HasSubstr("time step is too large")));
  EXPECT_THAT(message({0.5, nan, 0.5}, {0, 0, 0}, 1e-4),
              AllOf(HasSubstr("is not finite"), HasSubstr("after step 0")));
  EXPECT_THAT(
      message({0.5, 0.5, 0.5}, {0, 0, 0}, 1e-4, {-1, 0, 0, 0, 1, 0, 0, 0, 1}),  // log of J < 0
      HasSubstr("is not finite"));
}

TEST(Rollout, RefusesWhatDoesNotFit) {
  const auto law = std::make_shared<SimpleLaw<double>>(1e5, 1e5);
  const auto message = [&](GridSettings grid, std::vector<BodyRange<double>> bodies,
                           std::vector<double> mass, std::vector<double> volume) -> std::string {
    try {
      Rollout<double>(grid, bodies, mass, volume);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  const std::vector<double> two(2, 1);
  GridSettings grid;
  EXPECT_EQ(message(grid, {{0, 2, law}}, two, two), "no error");
  EXPECT_THAT(message(grid, {{0, 2, nullptr}}, two, two), HasSubstr("body 0 has no law"));
  EXPECT_THAT(message(grid, {}, {}, {}), HasSubstr("at least one particle"));
  EXPECT_THAT(message(grid, {{0, 1, law}, {2, 3, law}}, {1, 1, 1}, {1, 1, 1}),
              HasSubstr("body 1: expected particles from 1 on, found the range [2, 3)"));
  EXPECT_THAT(message(grid, {{0, 2, law}}, {1}, two), HasSubstr("2 numbers in mass, found 1"));
  EXPECT_THAT(message(grid, {{0, 2, law}}, {1, 0}, two), HasSubstr("mass of particle 1"));
  EXPECT_THAT(message(grid, {{0, 2, law}}, two, {-1, 1}), HasSubstr("volume of particle 0"));
  grid.n = 3;
  EXPECT_THAT(message(grid, {{0, 2, law}}, two, two), HasSubstr("nodes a side, found 3"));
  grid = {};
  grid.dt = 0;
  EXPECT_THAT(message(grid, {{0, 2, law}}, two, two), HasSubstr("time step"));
  grid = {};
  grid.bound = 11;
  EXPECT_THAT(message(grid, {{0, 2, law}}, two, two), HasSubstr("bound = 11"));
  grid = {};
  grid.gravity[1] = std::nan("");
  EXPECT_THAT(message(grid, {{0, 2, law}}, two, two), HasSubstr("finite gravity"));
}

}  // namespace
}  // namespace uniphy::kernels
