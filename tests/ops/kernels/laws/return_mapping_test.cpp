// The plastic laws at their yield surfaces and in their limits.

#include <gtest/gtest.h>

#include <string>

#include "ops/kernels/laws/analytic_law.hpp"
#include "tests/support/law_gradients.hpp"
#include "tests/support/law_invariants.hpp"

namespace uniphy::testing {
namespace {

using kernels::Isa;
using kernels::LawDescription;
using kernels::LawId;

class Plastic : public ::testing::TestWithParam<LawId> {};
INSTANTIATE_TEST_SUITE_P(All, Plastic,
                         ::testing::Values(LawId::plasticine, LawId::sand, LawId::non_newtonian,
                                           LawId::volume_corrected_sand, LawId::cohesive_sand,
                                           LawId::herschel_bulkley),
                         [](const auto& info) {
                           return std::string(kernels::law_name(info.param));
                         });

TEST_P(Plastic, KeepsTheBitsOfFInsideAndProjectsOntoTheSurfaceOutside) {
  const LawDescription d = sample_law(GetParam());
  const auto law = kernels::make_analytic_law<double>(d);
  std::mt19937_64 random(23);
  for (int i = 0; i < 100; ++i) {
    const double t = -0.05, k = yield_norm(d, t);
    const Matrix inside = strained(0.9 * k, t, random), outside = strained(2 * k, t, random);
    EXPECT_EQ(apply_law(*law, 1e-4, inside).F_proj, inside);
    const Matrix projected = apply_law(*law, 1e-4, outside).F_proj;
    EXPECT_GT(norm(projected - outside), 1e-3);
    const Eigen::Matrix3d e = hencky_tensor(projected);
    const double q = (e - e.trace() / 3 * Eigen::Matrix3d::Identity()).norm();
    EXPECT_NEAR(e.trace(), t, 2e-14);
    if (is_rate_dependent(GetParam())) {
      EXPECT_GT(q, 1.001 * k);
      EXPECT_LT(q, 2 * k);
    } else {
      EXPECT_NEAR(q, k, 2e-14);
    }
  }
}

// Just off the surface, on either side, the gradient is that of its own side.
TEST_P(Plastic, GradientsHoldOnBothSidesOfTheSurface) {
  const LawDescription d = sample_law(GetParam());
  std::mt19937_64 random(27);
  for (const double off : {-1e-2, -3e-3, 3e-3, 1e-2}) {
    for (int i = 0; i < 20; ++i) {
      const double t = -0.05;
      const Matrix F = strained(yield_norm(d, t) * (1 + off), t, random);
      for (const Stage stage : {Stage::project, Stage::fused}) {
        const LawGradientCheck check = make_check(GetParam(), stage, kernels::active_isa(), random);
        const auto e = check.errors(F, Matrix{}, parameter_array(d), 2e-6);
        // The power of the excess bends without bound towards the surface.
        const double tolerance = GetParam() == LawId::herschel_bulkley ? 1e-6 : 1e-7;
        EXPECT_LE(e.worst(), tolerance) << stage_name(stage) << " at " << off;
      }
    }
  }
}

// In a band of rounding width round the surface a particle may take either branch, but it must take
// one of the two: the gradient is close to that of one side, and outside the band of the right one.
TEST_P(Plastic, FlipsAreConfinedToTheBand) {
  const LawDescription d = sample_law(GetParam());
  const auto& entry = kernels::law_table<double>().laws[static_cast<int>(GetParam())];
  const auto parameters = to_parameters(parameter_array(d));
  std::mt19937_64 random(33);
  int flips = 0;
  const int count = 400;
  for (int i = 0; i < count; ++i) {
    const double t = -0.05, k = yield_norm(d, t);
    const double off = (i % 2 ? 1 : -1) * std::pow(10.0, -15 + 5.0 * i / count);
    const Matrix F = strained(k * (1 + off), t, random);
    Matrix projected;
    entry.project(1, parameters, 1e-4, {F.data(), 9, 1}, {projected.data(), 9, 1}, {});
    const bool yielded = projected != F;
    if (yielded != (off > 0)) {
      ++flips;
      EXPECT_LT(std::abs(off), 1e-13);
    }
    EXPECT_LE(norm(projected - F), 2 * k * std::abs(off) + 1e-14);
    const Matrix W = random_matrix(random);
    Matrix grad;
    entry.project_adjoint(1, parameters, 1e-4, {F.data(), 9, 1}, {W.data(), 9, 1},
                          {grad.data(), 9, 1}, nullptr, {});
    EXPECT_EQ(grad == W, !yielded);
  }
  EXPECT_LE(flips, count / 4);
}

// The tip of the cone: in tension sand becomes its rotation, and the stress is gone.
TEST(DruckerPrager, TensionLeavesARotation) {
  const LawDescription d = sample_law(LawId::sand);
  const auto law = kernels::make_analytic_law<double>(d);
  std::mt19937_64 random(35);
  for (int i = 0; i < 50; ++i) {
    const LawState state = apply_law(*law, 1e-4, strained(0.1, 0.05, random));
    EXPECT_LE(norm(multiply(state.F_proj, transposed(state.F_proj)) - identity()), 1e-14);
    EXPECT_NEAR(det(state.F_proj), 1, 1e-14);
    EXPECT_LE(norm(state.tau), 1e-9);
  }
}

// ---- laws outside of the five families ----------------------------------------------------------

// Cohesive sand bears a tension up to its cohesion, and tears there.
TEST(CohesiveSand, TearsAtItsCohesion) {
  const LawDescription d = sample_law(LawId::cohesive_sand);
  const auto law = kernels::make_analytic_law<double>(d);
  LawDescription loose = d;
  loose.id = LawId::sand;
  const auto sand = kernels::make_analytic_law<double>(loose);
  std::mt19937_64 random(65);
  for (int i = 0; i < 50; ++i) {
    const LawState torn = apply_law(*law, 1e-4, strained(0.1, 0.05, random));
    EXPECT_NEAR(hencky_tensor(torn.F_proj).trace(), d.cohesion, 1e-14);
    EXPECT_NEAR(torn.tau[0], (2 * d.mu / 3 + d.lambda) * d.cohesion, 1e-8);
    const Matrix held = strained(0.2 * yield_norm(d, 0.01), 0.01, random);
    EXPECT_EQ(apply_law(*law, 1e-4, held).F_proj, held);
    // Elsewhere it is sand under the pressure of its cohesion.
    const Matrix F = strained(0.1, -0.05, random);
    const LawState a = apply_law(*law, 1e-4, F);
    const LawState b = apply_law(*sand, 1e-4, F * std::exp(-d.cohesion / 3));
    EXPECT_LE(norm(a.F_proj - b.F_proj * std::exp(d.cohesion / 3)), 1e-14);
  }
}

/// ‖s‖ of F, the norm of the deviatoric stress at the shear modulus mu.
double deviatoric_norm(const Matrix& F, double mu) {
  const Eigen::Matrix3d e = hencky_tensor(F);
  return 2 * mu * (e - e.trace() / 3 * Eigen::Matrix3d::Identity()).norm();
}

TEST(HerschelBulkley, SolvesItsEquationAtEveryIndexAndConsistency) {
  LawDescription d = sample_law(LawId::herschel_bulkley);
  std::mt19937_64 random(67);
  for (const Isa isa : kernels::available_isas()) {
    for (const double n : {0.2, 0.5, 1.0, 1.7, 4.0}) {
      for (const double eta : {1e-2, 1.0, 1e2, 1e4, 1e6}) {
        for (const double excess : {1e-6, 1e-3, 0.1, 3.0}) {
          d.n = n, d.eta = eta;
          const double dt = 3e-4;
          const auto law = kernels::make_analytic_law<double>(d, isa);
          const Matrix F = strained(d.tau_y / (2 * d.mu) * (1 + excess), -0.02, random);
          const Matrix projected = apply_law(*law, dt, F).F_proj;
          const double trial = deviatoric_norm(F, d.mu), s = deviatoric_norm(projected, d.mu);
          const double y = s - d.tau_y, rounding = 1e-11 * d.tau_y;  // of 2 mu times that of F
          EXPECT_GE(y, -rounding);
          EXPECT_LE(s, trial + rounding);
          // By its two sides, whose slope may be anything: between the roots of both ends.
          const auto residual = [&](double x) {
            return x + 2 * d.mu * dt * std::pow(x / eta, 1 / n) - (trial - d.tau_y);
          };
          EXPECT_GE(residual(std::max(0.0, y + rounding)), 0) << n << " " << eta << " " << excess;
          EXPECT_LE(residual(std::max(0.0, y - rounding)), rounding)
              << n << " " << eta << " " << excess;
        }
      }
    }
  }
}

TEST(HerschelBulkley, OfIndexOneIsBingham) {
  LawDescription d = sample_law(LawId::herschel_bulkley);
  d.n = 1;
  const double dt = 1e-4, share = 1 / (1 + 2 * d.mu * dt / d.eta);
  std::mt19937_64 random(69);
  const auto law = kernels::make_analytic_law<double>(d);
  const Matrix F = strained(2 * d.tau_y / (2 * d.mu), -0.05, random);
  const double s = deviatoric_norm(apply_law(*law, dt, F).F_proj, d.mu);
  EXPECT_NEAR(s, d.tau_y * (1 + share), 1e-9 * d.tau_y);
}

// ---- sand with volume correction ----------------------------------------------------------------

/// One particle through one step of the law.
struct Corrected {
  Matrix F_proj{}, tau{};
  double memory = 0;
};
Corrected corrected_step(const kernels::LawKernel<double>& law, const Matrix& F, double before) {
  Corrected r;
  law.evaluate(1, 1e-4, {F.data(), 9, 1}, {}, {r.F_proj.data(), 9, 1}, {r.tau.data(), 9, 1},
               {{&before, 1, 1}, {&r.memory, 1, 1}});
  return r;
}

// Tampubolon et al. 2017: the mapping of sand at ε + v_c/3, and v_c += tr ε − tr ε'.
TEST(VolumeCorrectedSand, ProjectsTheShiftedStrainAndKeepsTheRest) {
  LawDescription d = sample_law(LawId::volume_corrected_sand);
  std::mt19937_64 random(61);
  for (const Isa isa : kernels::available_isas()) {
    const auto law = kernels::make_analytic_law<double>(d, isa);
    LawDescription plain = d;
    plain.id = LawId::sand;
    const auto sand = kernels::make_analytic_law<double>(plain, isa);
    for (int i = 0; i < 200; ++i) {
      const double before = i % 4 == 0 ? 0 : 0.05 * (i % 4);
      const Matrix F = strained(0.02 * (i % 7), 0.1 * (i % 5) - 0.25, random);
      const double trial = hencky_tensor(F).trace();
      const Matrix shifted = F * std::exp(before / 3);  // the same U and V
      const LawState expected = apply_law(*sand, 1e-4, shifted);
      const Corrected found = corrected_step(*law, F, before);
      EXPECT_LE(norm(found.F_proj - expected.F_proj), 1e-14);
      EXPECT_LE(norm(found.tau - expected.tau), 1e-13 * d.lambda);
      const double kept = before + trial - hencky_tensor(found.F_proj).trace();
      EXPECT_NEAR(found.memory, kept, 1e-14);
      EXPECT_GE(found.memory, 0);
      if (before == 0 && found.memory == 0 && apply_law(*sand, 1e-4, F).F_proj == F) {
        EXPECT_EQ(found.F_proj, F);  // the bits of F inside
      }
    }
  }
}

// What the law exists for. A particle is pulled apart, step by step, and pushed back to where it
// was: with the correction it bears nothing on the way and is as it was at the end; without, it is
// crushed by all that it had gained.
TEST(VolumeCorrectedSand, GivesBackTheVolumeThatASeparationGained) {
  const LawDescription d = sample_law(LawId::volume_corrected_sand);
  const auto law = kernels::make_analytic_law<double>(d);
  Corrected state{identity(), {}, 0};
  const auto stretch = [&](double by) {
    state = corrected_step(*law, state.F_proj * std::exp(by / 3), state.memory);
  };
  for (int i = 0; i < 20; ++i) stretch(0.05);
  EXPECT_NEAR(state.memory, 1.0, 1e-14);
  for (int i = 0; i < 19; ++i) {
    stretch(-0.05);
    EXPECT_EQ(norm(state.tau), 0) << i;
  }
  stretch(-0.05);
  EXPECT_NEAR(state.memory, 0, 1e-14);
  EXPECT_LE(norm(state.F_proj - identity()), 1e-14);
  stretch(-0.05);
  EXPECT_NEAR(state.tau[0] + state.tau[4] + state.tau[8], (2 * d.mu + 3 * d.lambda) * -0.05, 1e-8);
}

TEST(VolumeCorrectedSand, GradientsMatchCentralDifferencesAtEveryMemory) {
  const LawDescription d = sample_law(LawId::volume_corrected_sand);
  std::mt19937_64 random(63);
  int reached = 0;
  for (const Isa isa : kernels::available_isas()) {
    for (const double memory : {0.0, 0.004, 0.03, 0.7}) {
      for (const Stage stage : {Stage::project, Stage::fused}) {
        for (const DeformationCase& c : cases_of(d)) {
          LawGradientCheck check = make_check(d.id, stage, isa, random);
          check.memory = memory;
          if (memory == 0 && is_clamped(c)) continue;
          const auto e = check.errors(c.F, Matrix{}, parameter_array(d), c.step);
          EXPECT_LE(e.worst(), 1e-6) << stage_name(stage) << ", " << c.group << ", " << memory;
          double by_memory = 0;
          Matrix grad_F, grad_C;
          ParameterArray grad;
          check.adjoint(c.F, Matrix{}, parameter_array(d), grad_F, grad_C, grad, &by_memory);
          if (std::abs(by_memory) > 1e-3) ++reached;
        }
      }
    }
  }
  EXPECT_GT(reached, 100);
}

TEST(Viscoplastic, IsPlasticineAtZeroViscosity) {
  LawDescription fluid = sample_law(LawId::non_newtonian), solid = sample_law(LawId::plasticine);
  fluid.eta = 0;
  for (const Isa isa : kernels::available_isas()) {
    const auto a = kernels::make_analytic_law<double>(fluid, isa);
    const auto b = kernels::make_analytic_law<double>(solid, isa);
    for (const Matrix& F : sound_deformations()) {
      const LawState x = apply_law(*a, 1e-4, F), y = apply_law(*b, 1e-4, F);
      EXPECT_LE(norm(x.F_proj - y.F_proj), 1e-15 * norm(F));
      EXPECT_LE(norm(x.tau - y.tau), 1e-15 * fluid.lambda);
    }
  }
}

TEST(Viscoplastic, IsTheIdentityAtInfiniteViscosityOrZeroTime) {
  LawDescription d = sample_law(LawId::non_newtonian);
  for (const auto& [eta, dt] : {std::pair<double, double>{1e25, 1e-4}, {5, 0}, {5, 1e-30}}) {
    d.eta = eta;
    const auto law = kernels::make_analytic_law<double>(d);
    for (const Matrix& F : sound_deformations())
      EXPECT_LE(norm(apply_law(*law, dt, F).F_proj - F), 1e-14 * norm(F));
  }
}

// A clamp at 0.05 sits inside the logarithm: values continue, derivatives of what is below vanish.
TEST(Hencky, StretchesAreClampedBeforeTheLogarithm) {
  const LawDescription d = sample_law(LawId::plasticine);
  const auto& entry = kernels::law_table<double>().laws[static_cast<int>(d.id)];
  const auto parameters = to_parameters(parameter_array(d));
  const auto stress = [&](double s) {
    Matrix tau;
    const Matrix F = diagonal(1.1, 0.9, s);
    entry.stress(1, parameters, {F.data(), 9, 1}, {}, {tau.data(), 9, 1});
    return tau;
  };
  const double e[3] = {std::log(1.1), std::log(0.9), std::log(0.05)};
  const double trace = e[0] + e[1] + e[2];
  for (const double s : {0.05, 0.01, 0.0, -0.3}) {
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(stress(s)[4 * i], 2 * d.mu * e[i] + d.lambda * trace, 1e-8) << s;
  }
  EXPECT_NEAR(stress(0.06)[8],
              2 * d.mu * std::log(0.06) + d.lambda * (e[0] + e[1] + std::log(0.06)), 1e-8);
}

}  // namespace
}  // namespace uniphy::testing
