#include "uniphy/data/drawn_states.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "uniphy/data/law_branches.hpp"
#include "uniphy/data/material_ranges.hpp"

namespace uniphy {
namespace {

using kernels::LawDescription;
using kernels::LawId;
using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr double kDt = 1.0 / 4800;

Eigen::Map<const Matrix> matrix(const std::vector<double>& rows, std::int64_t s) {
  return Eigen::Map<const Matrix>(rows.data() + 9 * s);
}

LawDescription random_law(const MaterialRanges& ranges, UniformRandom& random) {
  return material_at(ranges,
                     {random.unit(), random.unit(), random.unit(), random.unit(), random.unit()});
}

class DrawnStates : public ::testing::TestWithParam<std::size_t> {
 protected:
  const MaterialRanges& ranges() const { return default_material_ranges()[GetParam()]; }
};

TEST_P(DrawnStates, LieInTheBranchThatWasAskedFor) {
  UniformRandom random(1);
  const DrawnStateRanges from;
  int visited = 0;
  for (int trial = 0; trial < 30; ++trial) {
    const LawDescription law = random_law(ranges(), random);
    for (std::size_t b = 0; b < branch_names(law.id).size(); ++b) {
      const int branch = static_cast<int>(b);
      if (!branch_reachable(law, kDt, branch, from)) continue;
      ++visited;
      const LawSamples states = draw_states(law, kDt, branch, 40, from, random);
      ASSERT_EQ(states.size(), 40);
      for (const SampleFeatures& f : sample_features(law, states)) {
        EXPECT_EQ(f.branch, branch) << branch_names(law.id)[b] << " mu " << law.mu << " lambda "
                                    << law.lambda << " strain " << f.strain;
        EXPECT_LE(f.strain, 1.0);
      }
    }
  }
  EXPECT_GT(visited, 40);
}

TEST_P(DrawnStates, AreWhatTheLawAnswers) {
  UniformRandom random(2);
  const LawDescription law = random_law(ranges(), random);
  const LawSamples states = draw_states(law, kDt, 0, 30, {}, random);
  std::vector<double> F_proj(states.F.size()), tau(states.F.size());
  kernels::make_law<double>(law)->evaluate(30, kDt, {states.F.data(), 9, 1},
                                           {states.C.data(), 9, 1}, {F_proj.data(), 9, 1},
                                           {tau.data(), 9, 1});
  for (std::size_t k = 0; k < tau.size(); ++k) {
    EXPECT_NEAR(states.F_proj[k], F_proj[k], 1e-14);
    EXPECT_NEAR(states.tau[k], tau[k], 1e-12 * (law.mu + law.lambda));
  }
}

TEST_P(DrawnStates, CoverTheRatesAndStayBelowTheStress) {
  UniformRandom random(3);
  const LawDescription law = random_law(ranges(), random);
  DrawnStateRanges from;
  from.stress = law.id == LawId::newtonian ? 100 * law.mu : 0.01 * law.mu;
  const LawSamples states = draw_states(law, kDt, 1, 500, from, random);
  double slow = 1e9, fast = 0, stress = 0;
  for (std::int64_t s = 0; s < states.size(); ++s) {
    const double rate = matrix(states.C, s).norm();
    slow = std::min(slow, rate);
    fast = std::max(fast, rate);
    stress = std::max(stress, matrix(states.tau, s).norm());
  }
  EXPECT_GT(slow, 0.0999);
  EXPECT_LT(slow, 0.3);
  EXPECT_GT(fast, 30);
  EXPECT_LT(fast, 100.001);
  // A yield surface has the deviatoric stress that it has.
  const bool von_mises = law.id == LawId::plasticine || law.id == LawId::non_newtonian;
  EXPECT_LE(stress, std::max(from.stress, von_mises ? 1.5 * law.tau_y : 0));
}

INSTANTIATE_TEST_SUITE_P(Materials, DrawnStates, ::testing::Range<std::size_t>(0, 5),
                         [](const auto& info) {
                           return default_material_ranges()[info.param].name();
                         });

TEST(DrawnStatesOf, NewtonianAreOneStepFromAMultipleOfTheIdentity) {
  UniformRandom random(4);
  const LawDescription law = material_at(default_material_ranges()[1], {0.5, 0.5, 0.5, 0.5, 0.5});
  for (const int branch : {1, 2}) {
    const LawSamples states = draw_states(law, kDt, branch, 200, {}, random);
    for (std::int64_t s = 0; s < states.size(); ++s) {
      const Matrix F = matrix(states.F, s), C = matrix(states.C, s);
      EXPECT_GE(F.determinant(), 0.6 - 1e-9);
      EXPECT_LE(F.determinant(), 1.3 + 1e-9);
      const Matrix before = (Matrix::Identity() + kDt * C).inverse() * F;
      EXPECT_LT((before - before(0, 0) * Matrix::Identity()).norm(), 1e-12);
    }
  }
}

TEST(DrawnStatesOf, RestHoldTheIdentityItself) {
  UniformRandom random(5);
  const LawDescription law = material_at(default_material_ranges()[0], {0.5, 0.5, 0.5, 0.5, 0.5});
  const LawSamples states = draw_states(law, kDt, 0, 20, {}, random);
  EXPECT_EQ(matrix(states.F, 0), Matrix::Identity());
  EXPECT_EQ(matrix(states.C, 10), Matrix::Zero());
  EXPECT_NE(matrix(states.F, 1), Matrix::Identity());
}

TEST(DrawnStatesOf, ASurfaceOutOfReachIsNotDrawn) {
  LawDescription law;
  law.id = LawId::plasticine;
  law.mu = 1e4;
  law.lambda = 1e4;
  law.tau_y = 1e4;  // yields at 0.5
  DrawnStateRanges from;
  EXPECT_TRUE(branch_reachable(law, kDt, 0, from));
  EXPECT_FALSE(branch_reachable(law, kDt, 1, from));
  from.yield_strain = 1;
  EXPECT_TRUE(branch_reachable(law, kDt, 1, from));
  // Far outside is more than a step away.
  EXPECT_FALSE(branch_reachable(law, kDt, 3, from));
  law.mu = 1e6;
  EXPECT_TRUE(branch_reachable(law, kDt, 3, from));
}

}  // namespace
}  // namespace uniphy
