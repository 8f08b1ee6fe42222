// The state of a body at the first frame as polynomials in the place.

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "ops/base/torch.hpp"
#include "tests/support/finite_differences.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/inference/quick_fit.hpp"
#include "uniphy/inference/deformed_start.hpp"
#include "uniphy/inference/initial_fields.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

InitialState random_state(int degree, std::uint32_t seed = 7) {
  InitialState s(RigidMotion{{0.4, 0.5, 0.6}, {0.3, -1, 0.2}, {2, -1, 0.5}});
  s.degree = degree;
  s.radius = 0.2;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 0.1);
  s.numbers.resize(initial_numbers(degree) - 6);
  for (double& x : s.numbers) x = normal(random);
  return s;
}

std::vector<double> random_places(int count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(0.3, 0.7);
  std::vector<double> x(3 * count);
  for (double& c : x) c = place(random);
  return x;
}

std::vector<double> numbers(const Tensor& t) {
  const Tensor flat = t.contiguous();
  return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
}

TEST(InitialState, HasSoManyNumbers) {
  EXPECT_EQ(initial_numbers(0), 6);
  EXPECT_EQ(initial_numbers(1), 12 + 24);
  EXPECT_EQ(initial_numbers(2), 30 + 60);
  EXPECT_EQ(initial_numbers(3), 60 + 120);
}

TEST(InitialState, OfDegreeZeroIsARigidMotion) {
  const InitialState s = random_state(0);
  const std::vector<double> x = random_places(5);
  const InitialFields f = fields_of(s, x, 5);
  const std::vector<double> expected = s.velocities(x), found = numbers(f.v);
  for (std::size_t k = 0; k < expected.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-15);
  EXPECT_FALSE(f.C.defined());
  EXPECT_FALSE(f.F.defined());
}

TEST(InitialState, IsMadeOfItsNumbersAgain) {
  const InitialState s = random_state(2), again = with_numbers(random_state(2, 9), numbers_of(s));
  EXPECT_EQ(again.numbers, s.numbers);
  EXPECT_EQ(again.linear, s.linear);
  EXPECT_EQ(again.angular, s.angular);
}

class OfDegree : public ::testing::TestWithParam<int> {};

TEST_P(OfDegree, CIsTheGradientOfTheVelocity) {
  const InitialState s = random_state(GetParam());
  const std::vector<double> x = random_places(4);
  const std::vector<double> C = numbers(fields_of(s, x, 4).C);
  constexpr double kStep = 1e-6;
  for (int p = 0; p < 4; ++p) {
    for (int j = 0; j < 3; ++j) {
      std::vector<double> up = x, down = x;
      up[3 * p + j] += kStep;
      down[3 * p + j] -= kStep;
      const std::vector<double> a = numbers(fields_of(s, up, 4).v),
                                b = numbers(fields_of(s, down, 4).v);
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(C[9 * p + 3 * i + j], (a[3 * p + i] - b[3 * p + i]) / (2 * kStep), 1e-7);
    }
  }
}

TEST_P(OfDegree, FIsAStretchAndThatOfTracersIsNone) {
  const InitialState s = random_state(GetParam());
  const Tensor F = fields_of(s, random_places(6), 4).F;
  ASSERT_EQ(F.size(0), 6);
  const Tensor of_body = F.slice(0, 0, 4);
  EXPECT_LT((of_body - of_body.transpose(1, 2)).abs().max().item<double>(), 1e-14);
  EXPECT_GT(std::get<0>(torch::linalg_eigh(of_body)).min().item<double>(), 0);
  EXPECT_GT((of_body - torch::eye(3, torch::kFloat64)).abs().max().item<double>(), 0.01);
  EXPECT_TRUE(torch::equal(F.slice(0, 4), torch::eye(3, torch::kFloat64).expand({2, 3, 3})));
}

TEST_P(OfDegree, GradientsGoThroughTheFields) {
  const InitialState s = random_state(GetParam());
  const InitialBasis basis(random_places(5), 4, s);
  torch::manual_seed(1);
  const Tensor a = torch::randn({5, 3}, torch::kFloat64),
               b = torch::randn({5, 3, 3}, torch::kFloat64),
               c = torch::randn({5, 3, 3}, torch::kFloat64);
  const auto value = [&](const Tensor& n) {
    const InitialFields f = basis.fields(n);
    return (f.v * a).sum() + (f.C * b).sum() + (f.F * c).sum();
  };
  const Tensor at = numbers_of(s).requires_grad_();
  value(at).backward();
  const auto expected = testing::central_differences(
      [&](const std::vector<double>& n) {
        const torch::NoGradGuard no_grad;
        return value(torch::tensor(n, torch::kFloat64)).item<double>();
      },
      numbers(at.detach()), std::vector<double>(at.numel(), 1e-5));
  EXPECT_LT(testing::relative_error(numbers(at.grad()), expected), 1e-7);
}

INSTANTIATE_TEST_SUITE_P(Degrees, OfDegree, ::testing::Values(1, 2, 3));

/// Points that move as v t + ½ a t² with polynomials of the state's degree.
Observation polynomial_motion(const InitialState& s, double noise) {
  Observation o;
  o.start_degree = s.degree;
  o.particles = 200;
  o.volume.assign(200, 1e-5);
  o.frames = 9;
  const std::vector<double> x = random_places(200);
  const std::vector<double> v = numbers(fields_of(s, x, 200).v),
                            a = numbers(fields_of(random_state(s.degree, 11), x, 200).v);
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, 1);
  for (int f = 0; f < o.frames; ++f) {
    const double t = 2e-3 * f;
    o.time.push_back(t);
    for (std::size_t k = 0; k < x.size(); ++k)
      o.x.push_back(x[k] + t * v[k] + 0.5 * t * t * a[k] + noise * normal(random));
  }
  o.noise = noise;
  return o;
}

TEST(DeformedStart, ThePolynomialsOfTheVelocityAreFound) {
  InitialState s = random_state(2);
  Observation o = polynomial_motion(s, 0);
  s.centre = centre_of_mass(o);  // about which they are found
  s.radius = 0.5 * observed_size(o);
  o = polynomial_motion(s, 0);
  const std::vector<double> found = numbers(numbers_of(estimate_deformed_start(o).motion)),
                            truth = numbers(numbers_of(s));
  for (int k = 0; k < velocity_numbers(2); ++k) EXPECT_NEAR(found[k], truth[k], 1e-9) << k;
  for (std::size_t k = velocity_numbers(2); k < found.size(); ++k) EXPECT_EQ(found[k], 0);
}

TEST(DeformedStart, ItsSpreadIsThatOfTheNoise) {
  InitialState s = random_state(2);
  s.centre = centre_of_mass(polynomial_motion(s, 0));
  s.radius = 0.5 * observed_size(polynomial_motion(s, 0));
  const MotionEstimate found = estimate_deformed_start(polynomial_motion(s, 1e-4));
  const std::vector<double> at = numbers(numbers_of(found.motion)), truth = numbers(numbers_of(s));
  ASSERT_EQ(found.spread.size(), static_cast<std::size_t>(initial_numbers(2)));
  double square = 0;
  for (int k = 0; k < velocity_numbers(2); ++k)
    square += std::pow((at[k] - truth[k]) / found.spread[k], 2) / velocity_numbers(2);
  EXPECT_GT(square, 0.02);
  EXPECT_LT(square, 2);
  for (std::size_t k = velocity_numbers(2); k < at.size(); ++k)
    EXPECT_EQ(found.spread[k], kStretchSpread);
}

/// From where the body is pressed to the floor.
Observation pressed_body() {
  testing::ObservedScene scene;
  scene.side = 5;
  scene.grid = 12;
  scene.frames = 61;
  scene.motion = {{0.5, 0.41, 0.5}, {0.4, -2.5, -0.3}, {1.0, -2.0, 3.0}};
  Observation o = testing::observe(testing::elastic_body(), scene);
  constexpr int kFirst = 16;
  o.x.erase(o.x.begin(), o.x.begin() + 3 * o.particles * kFirst);
  o.time.erase(o.time.begin(), o.time.begin() + kFirst);
  o.frames -= kFirst;
  return o;
}

TEST(DeformedStart, TheLawOfABodyThatBeginsDeformedIsFound) {
  Observation o = pressed_body();
  const Inference rigid = testing::quick_elastic_fit(o);
  o.start_degree = 2;
  const Inference found = testing::quick_elastic_fit(o);
  EXPECT_LT(found.misfit.over_size, 0.01);
  EXPECT_LT(found.misfit.over_size, 0.1 * rigid.misfit.over_size);
  EXPECT_NEAR(found.fit.law.mu, 2e4, 0.05 * 2e4);
  EXPECT_GT(std::abs(rigid.fit.law.mu - 2e4), 0.1 * 2e4);
  EXPECT_EQ(found.fit.contact, 0);
  EXPECT_TRUE(found.check.start_is_rigid());  // nothing to warn of
}

}  // namespace
}  // namespace uniphy
