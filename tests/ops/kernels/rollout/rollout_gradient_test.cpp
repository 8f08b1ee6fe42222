// The adjoint of the fused roll-out against central differences.

#include <gtest/gtest.h>

#include <random>

#include "tests/ops/kernels/rollout/two_bodies.hpp"
#include "tests/support/finite_differences.hpp"

namespace uniphy::kernels {
namespace {

using testing::central_differences;
using testing::relative_error;

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

}  // namespace
}  // namespace uniphy::kernels
