#include "ops/kernels/rollout/rollout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <cmath>
#include <random>

#include "ops/kernels/base/error.hpp"
#include "tests/ops/kernels/rollout/simple_law.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/finite_differences.hpp"

namespace uniphy::kernels {
namespace {

using ::testing::AllOf;
using testing::central_differences;
using ::testing::HasSubstr;
using testing::relative_error;

/// Two random clouds of one body each, in motion and strained, near the wall at y = 0.
template <class T>
struct TwoBodies {
  std::ptrdiff_t particles;
  GridSettings grid;
  std::vector<T> mass, volume;
  ParticleState<T> state;
  T chi = 0;  ///< Pa; above 0, the second body has memory
  double parameters[2][4] = {{1e5, 2e5, 300, 0.01}, {3e4, 5e4, 100, 0.02}};

  explicit TwoBodies(std::ptrdiff_t count, unsigned seed = 1) : particles(count) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    grid.dt = 2e-4;
    const double v = 0.027 / double(count);
    std::vector<T> x;
    std::vector<T> velocity;
    const double centre[3] = {0.35, 0.31, 0.45}, v0[3] = {1, -2.5, -0.5};
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      for (int a = 0; a < 3; ++a) x.push_back(T(centre[a] + 0.15 * uniform(random)));
      for (int a = 0; a < 3; ++a) velocity.push_back(T(v0[a] + uniform(random)));
      volume.push_back(T(v * (1 + 0.3 * uniform(random))));
      mass.push_back(T(1000 * v * (1 + 0.3 * uniform(random))));
    }
    state = ParticleState<T>::undeformed(x, velocity);
    for (T& c : state.C) c = T(3 * uniform(random));
    for (T& f : state.F) f += T(0.05 * uniform(random));
  }
  Rollout<T> rollout() const {
    std::vector<BodyRange<T>> bodies;
    for (int b = 0; b < 2; ++b) {
      const double* p = parameters[b];
      std::shared_ptr<const LawKernel<T>> law =
          std::make_shared<SimpleLaw<T>>(p[0], p[1], p[2], p[3]);
      if (b == 1 && chi > 0) {
        law = std::make_shared<SimpleMemoryLaw<T>>(SimpleLaw<T>(p[0], p[1], p[2], p[3]), chi);
      }
      bodies.push_back(
          {b == 0 ? 0 : particles / 3, b == 0 ? particles / 3 : particles, std::move(law)});
    }
    return {grid, bodies, mass, volume};
  }
};

/// A random linear functional of the frames.
template <class T>
struct Loss {
  std::ptrdiff_t steps = 50, every = 7;

  std::vector<T> weights(std::ptrdiff_t count, unsigned seed) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::vector<T> w(static_cast<std::size_t>(count));
    for (T& x : w) x = T(uniform(random));
    return w;
  }
  double operator()(const Rollout<T>& rollout, const ParticleState<T>& initial,
                    RolloutGradient<T>* gradient = nullptr) const {
    const std::ptrdiff_t size = 3 * rollout.particles() * rollout.frame_count(steps, every);
    std::vector<T> x(size), v(size);
    RolloutTape<T> tape;
    rollout.record(initial, steps, every, x.data(), v.data(), &tape);
    const std::vector<T> wx = weights(size, 3), wv = weights(size, 4);
    double sum = 0;
    for (std::ptrdiff_t k = 0; k < size; ++k) sum += wx[k] * x[k] + 0.1 * wv[k] * v[k];
    if (gradient != nullptr) {
      std::vector<T> gv = wv;
      for (T& g : gv) g *= T(0.1);
      *gradient = rollout.adjoint(tape, wx.data(), gv.data());
    }
    return sum;
  }
};

struct GradientCase {
  Wall wall;
  std::ptrdiff_t steps;
  double chi = 0;
};
class RolloutGradientTest : public ::testing::TestWithParam<GradientCase> {};

TEST_P(RolloutGradientTest, AgreesWithCentralDifferences) {
  TwoBodies<double> scene(150);
  scene.grid.wall = GetParam().wall;
  scene.chi = GetParam().chi;
  if (scene.chi > 0) {
    for (int p = 0; p < 150; ++p) scene.state.memory.push_back(0.01 * p);
  }
  const Loss<double> loss{GetParam().steps, 7};
  RolloutGradient<double> g;
  loss(scene.rollout(), scene.state, &g);

  // Along random directions of each part of the state, and by each parameter.
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  struct Part {
    const char* name;
    std::vector<double> ParticleState<double>::*member;
    double step;
  };
  using State = ParticleState<double>;
  std::vector<Part> parts{{"x", &State::x, 1e-6},
                          {"v", &State::v, 1e-4},
                          {"C", &State::C, 1e-2},
                          {"F", &State::F, 1e-5}};
  if (scene.chi > 0) parts.push_back({"memory", &State::memory, 1e-3});
  for (const Part& part : parts) {
    for (int repeat = 0; repeat < 3; ++repeat) {
      const std::vector<double>& at = scene.state.*part.member;
      std::vector<double> direction(at.size());
      double expected = 0;
      for (std::size_t k = 0; k < at.size(); ++k) {
        direction[k] = normal(random);
        expected += direction[k] * (g.state.*part.member)[k];
      }
      const auto along = [&](const std::vector<double>& t) {
        State moved = scene.state;
        for (std::size_t k = 0; k < at.size(); ++k) {
          (moved.*part.member)[k] += t[0] * direction[k];
        }
        return loss(scene.rollout(), moved);
      };
      const auto found = central_differences(along, {0}, {part.step});
      EXPECT_NE(expected, 0) << part.name;
      EXPECT_LE(relative_error({expected}, found), 1e-6) << part.name;
    }
  }
  for (int b = 0; b < 2; ++b) {
    for (int k = 0; k < 4; ++k) {
      const auto value = [&](const std::vector<double>& p) {
        TwoBodies<double> other = scene;
        other.parameters[b][k] = p[0];
        return loss(other.rollout(), scene.state);
      };
      const double at = scene.parameters[b][k];
      const auto found = central_differences(value, {at}, {1e-3 * at});
      EXPECT_NE(found[0], 0);
      EXPECT_LE(relative_error({g.parameters[b][k]}, found), 1e-6) << "body " << b << ", " << k;
    }
  }
}
// 50 steps are two segments, of which the second is not full; 64 end on a segment, 71 between
// frames; 0 leave only the first frame.
INSTANTIATE_TEST_SUITE_P(, RolloutGradientTest,
                         ::testing::Values(GradientCase{Wall::freeslip, 50},
                                           GradientCase{Wall::noslip, 50},
                                           GradientCase{Wall::freeslip, 64},
                                           GradientCase{Wall::freeslip, 71},
                                           GradientCase{Wall::freeslip, 71, 1e4}));

TEST(Rollout, GradientOfNoStepsIsThatOfTheFrame) {
  TwoBodies<double> scene(20);
  RolloutGradient<double> g;
  const Loss<double> loss{0, 5};
  loss(scene.rollout(), scene.state, &g);
  EXPECT_EQ(g.state.x, loss.weights(60, 3));
  EXPECT_EQ(g.parameters[0], std::vector<double>(4, 0));
}

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
