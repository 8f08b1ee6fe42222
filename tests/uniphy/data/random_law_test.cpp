#include "uniphy/data/random_law.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "ops/kernels/laws/law.hpp"
#include "uniphy/data/random_law_samples.hpp"
#include "uniphy/data/random_rotation.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using kernels::LawId;
using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr double kDt = 2e-4;  // s

Matrix random_matrix(UniformRandom& random, double size) {
  Matrix m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = size * random.between(-1, 1);
  return m;
}

struct Answer {
  Matrix F_proj, tau;
};
Answer ask(const RandomLaw& law, const Matrix& F, const Matrix& C) {
  Answer a;
  law.evaluate(kDt, F.data(), C.data(), a.F_proj.data(), a.tau.data());
  return a;
}
Answer ask(const kernels::LawDescription& law, const Matrix& F, const Matrix& C) {
  Answer a;
  kernels::make_law<double>(law)->evaluate(1, kDt, {F.data(), 9, 1}, {C.data(), 9, 1},
                                           {a.F_proj.data(), 9, 1}, {a.tau.data(), 9, 1});
  return a;
}

kernels::LawDescription family(LawId id, double mu, double lambda) {
  kernels::LawDescription law;
  law.id = id;
  law.mu = mu;
  law.lambda = lambda;
  return law;
}

/// A law of numbers at random whose limit is known answers as that law does.
void expect_same(const RandomLaw& law, const kernels::LawDescription& known, double strain) {
  UniformRandom random(4);
  int yielding = 0;
  for (int k = 0; k < 60; ++k) {
    const Matrix F = Matrix::Identity() + random_matrix(random, strain * random.unit());
    const Matrix C = random_matrix(random, 20);
    const Answer a = ask(law, F, C), b = ask(known, F, C);
    EXPECT_LT((a.F_proj - b.F_proj).norm(), 1e-11);
    EXPECT_LT((a.tau - b.tau).norm(), 1e-9 * (b.tau.norm() + known.lambda * 1e-3));
    yielding += (b.F_proj - F).norm() > 1e-8 ? 1 : 0;
  }
  const bool solid = law.kind == RandomLawKind::solid;
  EXPECT_EQ(yielding > 0, !solid);
}

TEST(RandomLaw, OneWholeTermOfTwoIsNeoHookean) {
  RandomLaw law;
  law.elasticity.terms = {{ElasticTerm::Measure::whole, 3e4, 2}};
  law.elasticity.state = {5e4, 0, 0};
  expect_same(law, family(LawId::elastic, 3e4, 5e4), 0.3);
}

TEST(RandomLaw, TwoWholeTermsAreFixedCorotated) {
  RandomLaw law;
  law.elasticity.terms = {{ElasticTerm::Measure::whole, 6e4, 2},
                          {ElasticTerm::Measure::whole, -3e4, 1}};
  law.elasticity.state = {5e4, 2, 1};
  EXPECT_DOUBLE_EQ(law.elasticity.shear_modulus(), 3e4);
  expect_same(law, family(LawId::fixed_corotated, 3e4, 5e4), 0.3);
}

TEST(RandomLaw, TwoIsochoricTermsAreMooneyRivlin) {
  kernels::LawDescription known = family(LawId::mooney_rivlin, 0, 5e4);
  known.c1 = 2e4;
  known.c2 = 7e3;
  RandomLaw law;
  // tau = 2 c1 dev B - 2 c2 dev B^-1 at volume one, and a term of modulus G and exponent n is 2 G/n
  // dev lambda^n.
  law.elasticity.terms = {{ElasticTerm::Measure::isochoric, 2 * known.c1, 2},
                          {ElasticTerm::Measure::isochoric, 2 * known.c2, -2}};
  law.elasticity.state = {5e4, 2, 1};
  expect_same(law, known, 0.3);
}

TEST(RandomLaw, AStiffPressureAndAConstantViscosityAreNewtonian) {
  RandomLaw law;
  law.kind = RandomLawKind::fluid;
  law.elasticity.state = {7 * (2.0 / 3 * 300 + 4e4), 1, -6};
  law.viscosity.at_rest = law.viscosity.at_infinity = 150;
  law.whole_rate = true;
  expect_same(law, family(LawId::newtonian, 300, 4e4), 0.1);
}

TEST(RandomLaw, ConstantCapsAreThoseOfPlasticineAndNonNewtonian) {
  kernels::LawDescription known = family(LawId::plasticine, 1e5, 2e5);
  known.tau_y = 8e3;
  RandomLaw law;
  law.kind = RandomLawKind::plastic;
  law.elasticity = hencky_elasticity(1e5, 2e5);
  law.yield.cap.k = known.tau_y / (2 * known.mu);
  expect_same(law, known, 0.2);

  // At small strain, where the law's mean square stretch is 1.
  known.id = LawId::non_newtonian;
  known.tau_y = 80;
  known.eta = 30;
  law.yield.cap.k = known.tau_y / (2 * known.mu);
  law.yield.rate = {Overstress::Kind::linear, 1e-3, 2 * known.mu * 1e-3 / known.eta, 1};
  UniformRandom random(5);
  for (int k = 0; k < 40; ++k) {
    const Matrix F = Matrix::Identity() + random_matrix(random, 5e-3);
    const Answer a = ask(law, F, Matrix::Zero()), b = ask(known, F, Matrix::Zero());
    EXPECT_LT((a.F_proj - b.F_proj).norm(), 0.02 * (b.F_proj - F).norm() + 1e-12);
  }
}

TEST(RandomLaw, AStraightConeIsSand) {
  kernels::LawDescription known = family(LawId::sand, 1e5, 2e5);
  known.theta = 0.35;
  const double sine = std::sin(known.theta);
  RandomLaw law;
  law.kind = RandomLawKind::plastic;
  law.elasticity = hencky_elasticity(1e5, 2e5);
  law.yield.cap.slope = std::sqrt(2.0 / 3) * 2 * sine / (3 - sine) * 8e5 / 2e5;
  law.yield.cap.apex = 0;
  expect_same(law, known, 0.2);
  law.yield.cap.apex = known.cohesion = 0.05;
  known.id = LawId::cohesive_sand;
  expect_same(law, known, 0.2);
}

TEST(ShearViscosity, HasItsLimits) {
  for (const auto kind :
       {ShearViscosity::Kind::power, ShearViscosity::Kind::cross, ShearViscosity::Kind::bingham}) {
    const ShearViscosity v{kind, 80, 2, 0.1, 0.7};
    EXPECT_DOUBLE_EQ(v(0), 80);
    EXPECT_NEAR(v(1e12), 2, 0.1);
    EXPECT_LT(v(10), v(1));
  }
  // A yield stress of (80 - 2)/0.1 Pa.
  const ShearViscosity bingham{ShearViscosity::Kind::bingham, 80, 2, 0.1, 1};
  EXPECT_NEAR((bingham(1e3) - 2) * 1e3, 780, 1e-6);
}

TEST(Overstress, FlowAndItsInverseAgree) {
  for (const auto kind : {Overstress::Kind::linear, Overstress::Kind::power, Overstress::Kind::sinh,
                          Overstress::Kind::arsinh}) {
    for (const double exponent : {0.4, 1.0, 3.0}) {
      const Overstress o{kind, 0.02, 7, exponent};
      for (const double rate : {0.01, 1.0, 30.0})
        EXPECT_NEAR(o.flow(o.beyond(rate)), rate, 1e-10 * rate);
      // Near the surface every curve is the line of its slope.
      EXPECT_NEAR(o.flow(1e-8), 7e-8 / 0.02, 1e-10);
    }
  }
}

TEST(Overstress, AStepTakesOffWhatFlows) {
  const double q = 0.1, radius = 0.04;
  EXPECT_EQ(Overstress{}.returned(q, radius, kDt), radius);
  for (const auto kind : {Overstress::Kind::linear, Overstress::Kind::power, Overstress::Kind::sinh,
                          Overstress::Kind::arsinh}) {
    Overstress o{kind, 0.02, 50, 2};
    const double kept = o.returned(q, radius, kDt);
    EXPECT_NEAR(q - kept, kDt * o.flow(kept - radius), 1e-15);
    EXPECT_EQ(o.returned(radius, radius, kDt), radius);
    EXPECT_GT(kept, o.returned(q, radius, 10 * kDt));
    // At once where the rate has no limit, never where there is none.
    o.rate = 1e12;
    EXPECT_NEAR(o.returned(q, radius, kDt), radius, 1e-6);
    o.rate = 1e-12;
    EXPECT_NEAR(o.returned(q, radius, kDt), q, 1e-12);
  }
}

TEST(YieldCap, BendsClosesAndSeesTheLodeAngle) {
  YieldCap cap;
  cap.slope = 0.5;
  cap.apex = 0.02;
  cap.scale = 0.05;
  const Vector3d compression = Vector3d(1, 1, -2).normalized(), extension = -compression;
  const Vector3d shear = Vector3d(1, -1, 0).normalized();
  EXPECT_NEAR(cap.radius(-0.08, shear), 0.05, 1e-15);
  EXPECT_EQ(cap.radius(0.02, shear), 0);
  cap.bend = 0.5;
  EXPECT_LT(cap.radius(-0.08, shear), 0.05);
  cap.crush = 0.1;
  EXPECT_EQ(cap.radius(-0.08, shear), 0);
  EXPECT_EQ(cap.returned_trace(-0.2), 0.02 - 0.1);
  EXPECT_EQ(cap.returned_trace(0.2), 0.02);
  cap.lode = 0.8;
  const double ratio = cap.radius(-0.03, compression) / cap.radius(-0.03, extension);
  EXPECT_NEAR(std::min(ratio, 1 / ratio), 0.8, 1e-12);
}

/// States as an elastic or a plastic trajectory has them.
LawSamples states(std::uint64_t seed) {
  UniformRandom random(seed);
  LawSamples samples;
  for (int s = 0; s < 300; ++s) {
    const Matrix F = Matrix::Identity() + random_matrix(random, 0.1 * random.unit());
    const Matrix C = random_matrix(random, 20);
    samples.F.insert(samples.F.end(), F.data(), F.data() + 9);
    samples.C.insert(samples.C.end(), C.data(), C.data() + 9);
  }
  return samples;
}

class DrawnLaw : public ::testing::TestWithParam<RandomLawKind> {
 protected:
  static RandomLawSamples drawn(std::uint64_t seed) {
    const char* material = GetParam() == RandomLawKind::solid   ? "elastic"
                           : GetParam() == RandomLawKind::fluid ? "newtonian"
                           : seed % 2 == 0                      ? "sand"
                                                                : "plasticine";
    return draw_random_law(GetParam(), states(1), material, kDt, seed);
  }
};

TEST_P(DrawnLaw, IsFrameIndifferentAndFinite) {
  UniformRandom random(8);
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    const RandomLawSamples d = drawn(seed);
    ASSERT_EQ(d.samples.size(), 300);
    for (std::size_t s = 0; s < 30; ++s) {
      const Matrix F = Matrix::Map(&d.samples.F[9 * s]), C = Matrix::Map(&d.samples.C[9 * s]);
      const Matrix tau = Matrix::Map(&d.samples.tau[9 * s]);
      const Matrix Q = random_rotation(random);
      const Answer turned = ask(d.law, Q * F, Q * C * Q.transpose());
      ASSERT_TRUE(tau.allFinite());
      EXPECT_LT((turned.tau - Q * tau * Q.transpose()).norm(), 1e-9 * (tau.norm() + 1));
      const Matrix P = Matrix::Map(&d.samples.F_proj[9 * s]);
      EXPECT_LT((turned.F_proj * turned.F_proj.transpose() - Q * P * P.transpose() * Q.transpose())
                    .norm(),
                1e-9);
    }
  }
}

TEST_P(DrawnLaw, IsStiffUnderEveryStrainThatItWasAsked) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    const RandomLawSamples d = drawn(seed);
    // No stress where there is no strain and no rate.
    const Answer rest = ask(d.law, Matrix::Identity(), Matrix::Zero());
    EXPECT_EQ(rest.tau.norm(), 0);
    EXPECT_LT((rest.F_proj - Matrix::Identity()).norm(), 1e-15);
    // More pressure under compression.
    const Answer more = ask(d.law, 0.999 * Matrix::Identity(), Matrix::Zero());
    EXPECT_LT(more.tau.trace(), 0);
  }
}

TEST_P(DrawnLaw, FollowsFromItsSeed) {
  const RandomLawSamples a = drawn(3), b = drawn(3), c = drawn(5);
  EXPECT_EQ(a.samples.tau, b.samples.tau);
  EXPECT_EQ(a.samples.F_proj, b.samples.F_proj);
  EXPECT_NE(a.samples.tau, c.samples.tau);
}

INSTANTIATE_TEST_SUITE_P(Kinds, DrawnLaw, ::testing::ValuesIn(kRandomLawKinds),
                         [](const auto& info) { return std::string(random_law_name(info.param)); });

TEST(DrawnPlastic, ReturnsAlongTheDeviatorAndStays) {
  int yielding = 0, all = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    const RandomLawSamples d =
        draw_random_law(RandomLawKind::plastic, states(1), "sand", kDt, seed);
    UniformRandom random(seed);
    for (int k = 0; k < 50; ++k) {
      const Vector3d eps = 0.2 * random.direction();
      const Vector3d kept = d.law.yield.project(eps, kDt);
      const Vector3d before = eps.array() - eps.mean(), after = kept.array() - kept.mean();
      EXPECT_LT(before.cross(after).norm(), 1e-15);
      EXPECT_GE(before.dot(after), 0);
      EXPECT_LE(after.norm(), before.norm() * (1 + 1e-15));
      EXPECT_LE(kept.sum(), std::max(eps.sum(), d.law.yield.cap.returned_trace(eps.sum())) + 1e-15);
      if (d.law.yield.rate.kind != Overstress::Kind::none) continue;
      EXPECT_LT((d.law.yield.project(kept, kDt) - kept).norm(), 1e-15);  // G(G(F)) = G(F)
    }
    all += 300;
    for (std::size_t s = 0; s < 300; ++s)
      yielding +=
          (Matrix::Map(&d.samples.F[9 * s]) - Matrix::Map(&d.samples.F_proj[9 * s])).norm() > 0;
  }
  EXPECT_GT(yielding, 0.3 * all);
  EXPECT_LT(yielding, 0.9 * all);
}

TEST(RandomLaw, OnlyItsKindsAreNamedSo) {
  EXPECT_TRUE(is_random_law("random_solid") && is_random_law("random_plastic"));
  EXPECT_FALSE(is_random_law("sand") || is_random_law("random"));
}

}  // namespace
}  // namespace uniphy
