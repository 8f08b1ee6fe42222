// The analytic laws: independent numbers, gradients, invariants, instruction sets, the interface.
// The plastic ones in detail: return_mapping_test.cpp.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <string>

#include "ops/kernels/laws/analytic_law.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/law_gradients.hpp"
#include "tests/support/law_invariants.hpp"
#include "tests/support/reference_laws.hpp"

namespace uniphy::testing {
namespace {

using kernels::Isa;
using kernels::LawDescription;
using kernels::LawId;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string isa_suffix(Isa isa) { return kernels::isa_name(isa); }

class LawsOnIsa : public ::testing::TestWithParam<std::tuple<LawId, Isa>> {
 protected:
  LawId id() const { return std::get<0>(GetParam()); }
  Isa isa() const { return std::get<1>(GetParam()); }
};
std::string law_and_isa(const ::testing::TestParamInfo<std::tuple<LawId, Isa>>& info) {
  return std::string(kernels::law_name(std::get<0>(info.param))) + "_" +
         isa_suffix(std::get<1>(info.param));
}
INSTANTIATE_TEST_SUITE_P(All, LawsOnIsa,
                         ::testing::Combine(::testing::ValuesIn(analytic_laws()),
                                            ::testing::ValuesIn(kernels::available_isas())),
                         law_and_isa);

LawPromises promises_of(LawId id) {
  LawPromises p;
  p.fluid = is_fluid(id);
  p.elastic = id == LawId::elastic || id == LawId::fixed_corotated || id == LawId::mooney_rivlin;
  p.idempotent = !is_rate_dependent(id);
  return p;
}

// fixed_corotated and water, of which there are none, have their formulas below.
class LawsWithNumbers : public LawsOnIsa {};
INSTANTIATE_TEST_SUITE_P(All, LawsWithNumbers,
                         ::testing::Combine(::testing::Values(LawId::elastic, LawId::newtonian,
                                                              LawId::plasticine, LawId::sand,
                                                              LawId::non_newtonian),
                                            ::testing::ValuesIn(kernels::available_isas())),
                         law_and_isa);

TEST_P(LawsWithNumbers, AgreeWithIndependentNumbers) {
  const ReferenceLaw reference = read_reference_law(kernels::law_name(id()));
  ASSERT_GT(reference.size(), 0);
  const auto law = kernels::make_analytic_law<double>(reference.description, isa());
  std::vector<double> projected(reference.F.size()), tau(reference.F.size());
  law->evaluate(reference.size(), reference.dt, {reference.F.data(), 9, 1},
                {reference.C.data(), 9, 1}, {projected.data(), 9, 1}, {tau.data(), 9, 1});
  double scale = 0;
  for (const double x : reference.tau) scale = std::max(scale, std::abs(x));
  for (std::size_t i = 0; i < tau.size(); ++i) {
    EXPECT_NEAR(projected[i], reference.F_proj[i], 2e-14) << i;
    EXPECT_NEAR(tau[i], reference.tau[i], 1e-13 * scale) << i;
  }
}

TEST_P(LawsOnIsa, SatisfyTheInvariants) {
  LawPromises promises = promises_of(id());
  expect_law_invariants(*kernels::make_analytic_law<double>(sample_law(id()), isa()), 1e-4,
                        promises);
}

TEST_P(LawsOnIsa, SatisfyTheInvariantsInFloat) {
  LawPromises promises = promises_of(id());
  promises.tolerance = 2e-5;
  promises.stress_scale = 1e6;
  expect_law_invariants(*kernels::make_analytic_law<float>(sample_law(id()), isa()), 1e-4,
                        promises);
}

TEST_P(LawsOnIsa, FloatFollowsDouble) {
  const LawDescription d = sample_law(id());
  const auto single = kernels::make_analytic_law<float>(d, isa());
  const auto precise = kernels::make_analytic_law<double>(d, isa());
  std::mt19937_64 random(5);
  for (const Matrix& F : sound_deformations()) {
    Matrix rounded;
    for (int k = 0; k < 9; ++k) rounded[k] = float(F[k]);
    const Matrix C = random_matrix(random);
    const LawState a = apply_law(*single, 1e-4, rounded, C);
    const LawState b = apply_law(*precise, 1e-4, rounded, C);
    EXPECT_LE(norm(a.F_proj - b.F_proj), 5e-6);
    EXPECT_LE(norm(a.tau - b.tau), 5e-6 * std::max(norm(b.tau), 1e6));
  }
}

TEST_P(LawsOnIsa, FusedPathIsProjectionThenStress) {
  const auto& entry = kernels::law_table<double>(isa()).laws[static_cast<int>(id())];
  const auto parameters = to_parameters(parameter_array(sample_law(id())));
  std::mt19937_64 random(7);
  for (const DeformationCase& c : deformation_cases()) {
    const Matrix C = random_matrix(random, 10);
    Matrix projected, tau, fused_projected, fused_tau;
    entry.project(1, parameters, 1e-4, {c.F.data(), 9, 1}, {projected.data(), 9, 1}, {});
    entry.stress(1, parameters, {projected.data(), 9, 1}, {C.data(), 9, 1}, {tau.data(), 9, 1});
    entry.evaluate(1, parameters, 1e-4, {c.F.data(), 9, 1}, {C.data(), 9, 1},
                   {fused_projected.data(), 9, 1}, {fused_tau.data(), 9, 1}, {});
    // To rounding only: the compiler fuses multiplications and additions differently in each.
    EXPECT_LE(norm(fused_projected - projected), 2e-15 * norm(c.F)) << c.group;
    EXPECT_LE(norm(fused_tau - tau), 1e-13 * std::max(norm(tau), 1e5)) << c.group;
  }
}

TEST_P(LawsOnIsa, GradientsMatchCentralDifferences) {
  std::mt19937_64 random(13);
  const ParameterArray parameters = parameter_array(sample_law(id()));
  for (const Stage stage : {Stage::project, Stage::stress, Stage::fused}) {
    for (const DeformationCase& c : cases_of(sample_law(id()))) {
      const LawGradientCheck check = make_check(id(), stage, isa(), random);
      const auto e = check.errors(c.F, random_matrix(random, 3), parameters, c.step);
      const auto where = std::string(stage_name(stage)) + ", " + c.group +
                         ", sigma = " + ::testing::PrintToString(c.sigma);
      EXPECT_LE(e.F, 1e-6) << where;
      EXPECT_LE(e.C, check.linear_in_C ? 1e-8 : 1e-7) << where;
      EXPECT_LE(e.parameters, 1e-6) << where;
      if (!is_clamped(c)) {
        EXPECT_LE(e.memory, 1e-6) << where;
      }
    }
  }
}

// A gradient of zeros would pass wherever the differences vanish as well: say where they must not.
TEST_P(LawsOnIsa, GradientsAreNotSilentlyZero) {
  std::mt19937_64 random(17);
  LawGradientCheck check = make_check(id(), Stage::fused, isa(), random);
  const LawDescription d = sample_law(id());
  std::vector<double> reached(kernels::kLawParameters, 0.0);
  for (const Matrix& s : {diagonal(1.5, 0.8, 0.4), diagonal(0.9, 0.8, 0.7)}) {
    const Matrix F = composed(random_rotation(random), s, random_rotation(random));
    Matrix grad_F, grad_C;
    ParameterArray grad;
    check.adjoint(F, random_matrix(random, 3), parameter_array(d), grad_F, grad_C, grad);
    EXPECT_GT(norm(grad_F), 1e-3);
    EXPECT_EQ(norm(grad_C) > 0, is_viscous_fluid(id()));
    for (std::size_t i = 0; i < grad.size(); ++i) reached[i] += std::abs(grad[i]);
  }
  for (int i = 0; i < kernels::kLawParameters; ++i) {
    const bool has = std::count(check.places.begin(), check.places.end(), i) > 0;
    EXPECT_EQ(reached[static_cast<std::size_t>(i)] > 0, has) << "parameter " << i;
  }
}

TEST_P(LawsOnIsa, AgreeAcrossInstructionSets) {
  const LawDescription d = sample_law(id());
  const auto here = kernels::make_analytic_law<double>(d, isa());
  const auto baseline = kernels::make_analytic_law<double>(d, Isa::baseline);
  std::mt19937_64 random(19);
  std::vector<double> sum(kernels::kLawParameters, 0.0), baseline_sum = sum;
  for (const Matrix& F : sound_deformations()) {
    const Matrix C = random_matrix(random), gP = random_matrix(random);
    const Matrix gt = random_matrix(random, 1e-5);
    const LawState a = apply_law(*here, 1e-4, F, C), b = apply_law(*baseline, 1e-4, F, C);
    EXPECT_LE(norm(a.F_proj - b.F_proj), 2e-14);
    EXPECT_LE(norm(a.tau - b.tau), 1e-13 * std::max(norm(b.tau), 1e5));
    Matrix grad, baseline_grad;
    here->adjoint(1, 1e-4, {F.data(), 9, 1}, {C.data(), 9, 1}, {gP.data(), 9, 1}, {gt.data(), 9, 1},
                  {grad.data(), 9, 1}, {}, sum.data());
    baseline->adjoint(1, 1e-4, {F.data(), 9, 1}, {C.data(), 9, 1}, {gP.data(), 9, 1},
                      {gt.data(), 9, 1}, {baseline_grad.data(), 9, 1}, {}, baseline_sum.data());
    EXPECT_LE(norm(grad - baseline_grad), 1e-9 * std::max(norm(baseline_grad), 1.0));
  }
  for (std::size_t i = 0; i < sum.size(); ++i)
    EXPECT_NEAR(sum[i], baseline_sum[i], 2e-12 * std::abs(sum[i]));
}

class Formulas : public ::testing::TestWithParam<Isa> {};
INSTANTIATE_TEST_SUITE_P(All, Formulas, ::testing::ValuesIn(kernels::available_isas()),
                         [](const auto& info) { return isa_suffix(info.param); });

TEST_P(Formulas, FixedCorotated) {
  const LawDescription d = sample_law(LawId::fixed_corotated);
  const auto law = kernels::make_analytic_law<double>(d, GetParam());
  std::mt19937_64 random(39);
  for (int i = 0; i < 50; ++i) {
    const Matrix U = random_rotation(random), V = random_rotation(random);
    const Matrix F = composed(U, diagonal(1.3, 0.9, i % 2 ? 0.5 : -0.5), V);
    const Matrix R = multiply(U, transposed(V));
    const double J = det(F);
    const Matrix expected =
        multiply(F - R, transposed(F)) * (2 * d.mu) + identity() * (d.lambda * J * (J - 1));
    EXPECT_LE(norm(apply_law(*law, 1e-4, F).tau - expected), 2e-14 * norm(expected));
  }
}

TEST_P(Formulas, Water) {
  const LawDescription d = sample_law(LawId::water);
  const auto law = kernels::make_analytic_law<double>(d, GetParam());
  const LawState state = apply_law(*law, 1e-4, diagonal(1.2, 0.9, 0.8));
  const double J = 1.2 * 0.9 * 0.8;
  EXPECT_LE(norm(state.F_proj - identity() * std::cbrt(J)), 1e-15);
  EXPECT_LE(norm(state.tau - identity() * (d.lambda * J * (J - 1))), 1e-9);
  EXPECT_NEAR(apply_law(*law, 1e-4, diagonal(1, 1, -1)).F_proj[0], 1e-2, 1e-16);  // J = 1e-6
}

TEST_P(Formulas, MooneyRivlin) {
  const LawDescription d = sample_law(LawId::mooney_rivlin);
  const auto law = kernels::make_analytic_law<double>(d, GetParam());
  std::mt19937_64 random(41);
  const auto deviator = [](const Matrix& m) { return m - identity() * ((m[0] + m[4] + m[8]) / 3); };
  for (int i = 0; i < 50; ++i) {
    const Matrix F =
        composed(random_rotation(random), diagonal(1.4, 1.0, 0.6), random_rotation(random));
    const double J = det(F);
    const Matrix B = multiply(F, transposed(F)) * std::pow(J, -2.0 / 3);
    const Matrix expected =
        deviator(B * (2 * (d.c1 + d.c2 * (B[0] + B[4] + B[8]))) - multiply(B, B) * (2 * d.c2)) +
        identity() * (d.lambda * J * (J - 1));
    EXPECT_LE(norm(apply_law(*law, 1e-4, F).tau - expected), 1e-14 * norm(expected));
  }
  // Small strain: a shear modulus of 2 (c1 + c2).
  const double g = 1e-6;
  Matrix sheared = identity();
  sheared[1] = g;
  EXPECT_NEAR(apply_law(*law, 1e-4, sheared).tau[1], 2 * (d.c1 + d.c2) * g, 1e-9 * d.c1);
}

TEST_P(Formulas, Carreau) {
  const LawDescription d = sample_law(LawId::carreau);
  const auto law = kernels::make_analytic_law<double>(d, GetParam());
  // Simple shear at a rate g: the stress is eta(g) g.
  for (const double g : {1e-6, 0.1, 3.0, 1e3, 1e9}) {
    Matrix C{};
    C[1] = g;
    const double eta =
        d.eta_inf + (d.eta - d.eta_inf) * std::pow(1 + std::pow(d.kappa * g, 2), (d.n - 1) / 2);
    EXPECT_NEAR(apply_law(*law, 1e-4, identity(), C).tau[1], eta * g, 1e-13 * eta * g) << g;
  }
  // What expands is not sheared; the pressure is that of water.
  EXPECT_LE(norm(apply_law(*law, 1e-4, identity(), identity() * 5).tau), 1e-12);
  const double J = 0.9 * 0.8 * 1.1;
  EXPECT_NEAR(apply_law(*law, 1e-4, diagonal(0.9, 0.8, 1.1)).tau[0], d.lambda * J * (J - 1), 1e-9);
}

// ---- the interface ------------------------------------------------------------------------------

TEST(Laws, NamesGoBothWays) {
  for (int i = 0; i <= static_cast<int>(LawId::learned); ++i) {
    const LawId id = static_cast<LawId>(i);
    EXPECT_EQ(kernels::law_id(kernels::law_name(id)), id);
  }
  EXPECT_THAT(error_of([] { kernels::law_id("rubber"); }),
              AllOf(HasSubstr("non_newtonian"), HasSubstr("\"rubber\"")));
}

TEST(Laws, ParametersAreChecked) {
  const double nan = std::nan("");
  const auto make = [](LawId id, double LawDescription::*member, double value) {
    LawDescription d = sample_law(id);
    d.*member = value;
    kernels::make_law<double>(d);
  };
  const auto message = [&](LawId id, double LawDescription::*member, double value) {
    return error_of([&] { make(id, member, value); });
  };
  EXPECT_THAT(message(LawId::elastic, &LawDescription::mu, 0), HasSubstr("parameter mu"));
  EXPECT_THAT(message(LawId::elastic, &LawDescription::lambda, -3), HasSubstr("found -3"));
  EXPECT_THAT(message(LawId::plasticine, &LawDescription::tau_y, nan), HasSubstr("tau_y"));
  EXPECT_THAT(message(LawId::sand, &LawDescription::theta, 1.6), HasSubstr("pi/2"));
  EXPECT_THAT(message(LawId::non_newtonian, &LawDescription::eta, -1), HasSubstr("eta"));
  EXPECT_THAT(message(LawId::herschel_bulkley, &LawDescription::eta, 0), HasSubstr("eta"));
  EXPECT_THAT(message(LawId::carreau, &LawDescription::n, 0), HasSubstr("parameter n"));
  EXPECT_THAT(message(LawId::cohesive_sand, &LawDescription::cohesion, -0.1),
              HasSubstr("cohesion"));
  // Parameters that a law does not have are not looked at.
  EXPECT_NO_THROW(make(LawId::water, &LawDescription::mu, nan));
  EXPECT_NO_THROW(make(LawId::plasticine, &LawDescription::tau_y, 0));
}

TEST(Laws, ParameterGradientFollowsTheNames) {
  const auto law = kernels::make_law<double>(sample_law(LawId::sand));
  ASSERT_EQ(law->parameter_size(), 3);
  ASSERT_EQ(law->accumulator_size(), kernels::kLawParameters);
  const double accumulator[kernels::kLawParameters] = {1, 2, 3, 4, 5};
  double gradient[3];
  law->parameter_gradient(accumulator, gradient);
  EXPECT_EQ(gradient[0], 1);  // mu
  EXPECT_EQ(gradient[1], 2);  // lambda
  EXPECT_EQ(gradient[2], 4);  // theta
}

// The contract of the roll-out: gradients add up over chunks, F may be projected in place.
TEST_P(LawsOnIsa, WorksInPlaceAndAddsUp) {
  const auto law = kernels::make_analytic_law<double>(sample_law(id()), isa());
  const std::vector<Matrix> states = sound_deformations(32);
  const std::ptrdiff_t count = static_cast<std::ptrdiff_t>(states.size());
  std::vector<double> F, W(9 * states.size(), 0.25), out(9 * states.size()), tau(out.size());
  for (const Matrix& m : states) F.insert(F.end(), m.begin(), m.end());
  law->evaluate(count, 1e-4, {F.data(), 9, 1}, {}, {out.data(), 9, 1}, {tau.data(), 9, 1});
  std::vector<double> in_place = F;
  law->evaluate(count, 1e-4, {in_place.data(), 9, 1}, {}, {in_place.data(), 9, 1}, {});
  EXPECT_EQ(in_place, out);

  std::vector<double> grad(F.size()), grad_C(F.size(), 1.0), once(kernels::kLawParameters, 0.0),
      twice = once;
  law->adjoint(count, 1e-4, {F.data(), 9, 1}, {}, {W.data(), 9, 1}, {W.data(), 9, 1},
               {grad.data(), 9, 1}, {grad_C.data(), 9, 1}, once.data());
  std::vector<double> grad_in_place = W;
  for (int i = 0; i < 2; ++i) {
    std::copy(W.begin(), W.end(), grad_in_place.begin());
    law->adjoint(count, 1e-4, {F.data(), 9, 1}, {}, {grad_in_place.data(), 9, 1}, {W.data(), 9, 1},
                 {grad_in_place.data(), 9, 1}, {}, twice.data());
  }
  EXPECT_EQ(grad_in_place, grad);
  for (std::size_t i = 0; i < once.size(); ++i)
    EXPECT_NEAR(twice[i], 2 * once[i], 1e-15 * std::abs(once[i]));
  const LawDescription d = sample_law(id());
  const double of_C = id() == LawId::newtonian ? 1 + 0.25 * d.mu
                      : id() == LawId::carreau ? 1 + 2 * 0.25 * d.eta  // at rest
                                               : 1;
  EXPECT_NEAR(grad_C[1], of_C, 1e-15 * of_C);
}

}  // namespace
}  // namespace uniphy::testing
