// The errors of the isotropic form on every instruction set: values alike, gradients against
// central differences.

#include <gtest/gtest.h>

#include <algorithm>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/loss/law_losses_table.hpp"
#include "tests/support/finite_differences.hpp"
#include "tests/support/law_loss_cases.hpp"

namespace uniphy::kernels {
namespace {

using testing::LawLossCase;

/// The numbers of the first trajectory of a case, in another precision, with the log of its scales.
template <class T>
struct Trajectory {
  std::vector<T> columns, caps, moduli;
  std::vector<std::int64_t> rows;
  std::vector<double> inputs;  ///< log s, log e, rest_cap, rest_pressure, caps, moduli
  const LawLossCase& from;

  explicit Trajectory(const LawLossCase& c) : from(c) {
    columns.assign(c.columns.begin(), c.columns.end());
    rows.assign(c.rows.begin(), c.rows.begin() + c.samples);
    inputs = {9.2 + 3 * c.z[0], -3 + 2 * c.z[1], -0.3, 0.2};
    const auto append = [this](const std::vector<double>& v, std::int64_t count, int outputs) {
      for (int k = 0; k < outputs; ++k)
        for (std::int64_t i = 0; i < count; ++i) inputs.push_back(v[i * outputs + k]);
    };
    append(c.caps, c.state_caps ? c.samples : 1, kCapOutputs);
    append(c.moduli, c.state_moduli ? c.samples : 1, kStressOutputs);
  }

  IsotropicAnswers<T> answers(const std::vector<double>& x) {
    const std::int64_t split = 4 + (from.state_caps ? from.samples : 1) * kCapOutputs;
    caps.assign(x.begin() + 4, x.begin() + split);
    moduli.assign(x.begin() + split, x.end());
    IsotropicAnswers<T> a{};
    a.samples = {columns.data(), rows.data(), from.samples, T(std::exp(x[1]))};
    a.caps = caps.data();
    a.moduli = moduli.data();
    a.state_caps = from.state_caps;
    a.state_moduli = from.state_moduli;
    a.stress_scale = T(std::exp(x[0]));
    a.flow_time = T(from.scales[3]);
    a.rest_cap = T(x[2]);
    a.rest_pressure = T(x[3]);
    a.stress_floor2 = T(9e4);
    a.strain_floor2 = T(1e-4);
    a.delta = T(from.delta);
    return a;
  }
};

const double kWeights[kIsotropicLosses] = {0.7, 1.3, 0.4, -0.8};

template <class T>
std::vector<double> means(Isa isa, const LawLossCase& c) {
  Trajectory<T> t(c);
  T m[kIsotropicMeans];
  law_losses_table<T>(isa).errors(t.answers(t.inputs), m);
  return {m, m + kIsotropicMeans};
}

template <class T>
std::vector<double> gradient(Isa isa, const LawLossCase& c) {
  Trajectory<T> t(c);
  const IsotropicAnswers<T> a = t.answers(t.inputs);
  std::vector<T> caps(t.caps.size()), moduli(t.moduli.size());
  const T weights[kIsotropicLosses] = {T(kWeights[0]), T(kWeights[1]), T(kWeights[2]),
                                       T(kWeights[3])};
  IsotropicAnswersGradient<T> g{};
  g.caps = caps.data();
  g.moduli = moduli.data();
  law_losses_table<T>(isa).errors_adjoint(a, weights, g);
  std::vector<double> all{g.log_s, g.log_e, g.rest_cap, g.rest_pressure};
  all.insert(all.end(), caps.begin(), caps.end());
  all.insert(all.end(), moduli.begin(), moduli.end());
  return all;
}

/// The weighted means by central differences of the inputs.
std::vector<double> differences(Isa isa, const LawLossCase& c) {
  Trajectory<double> t(c);
  const auto loss = [&](const std::vector<double>& x) {
    double m[kIsotropicMeans], sum = 0;
    law_losses_table<double>(isa).errors(t.answers(x), m);
    for (int k = 0; k < kIsotropicLosses; ++k) sum += kWeights[k] * m[k];
    return sum;
  };
  return testing::central_differences(loss, t.inputs, std::vector<double>(t.inputs.size(), 1e-5));
}

class LawLossesOnIsa : public ::testing::TestWithParam<Isa> {};

TEST_P(LawLossesOnIsa, ValuesAndGradientsAreThoseOfTheBaseline) {
  for (const LawLossCase& c : testing::law_loss_cases()) {
    const auto value = means<double>(Isa::baseline, c), slope = gradient<double>(Isa::baseline, c);
    for (const double v : value) EXPECT_GT(v, 0);
    EXPECT_LE(testing::relative_error(means<double>(GetParam(), c), value), 1e-14);
    EXPECT_LE(testing::relative_error(means<float>(GetParam(), c), value), 2e-6);
    EXPECT_LE(testing::relative_error(gradient<double>(GetParam(), c), slope), 1e-14);
    EXPECT_LE(testing::relative_error(gradient<float>(GetParam(), c), slope), 2e-6);
  }
}

TEST_P(LawLossesOnIsa, GradientsAgreeWithCentralDifferences) {
  for (const LawLossCase& c : testing::law_loss_cases()) {
    // The share weighs a missed cap as a constant, which differences do not know.
    auto got = gradient<double>(GetParam(), c), want = differences(GetParam(), c);
    const std::int64_t count = c.state_caps ? c.samples : 1;
    for (std::int64_t k = 0; k < count; ++k)
      got[std::size_t(4 + 3 * count + k)] = want[std::size_t(4 + 3 * count + k)] = 0;
    EXPECT_LE(testing::relative_error(got, want), 2e-8)
        << c.samples << " samples, " << c.state_caps << c.state_moduli;
  }
}

TEST_P(LawLossesOnIsa, TheShareHasItsGradientWhereTheLawCuts) {
  for (LawLossCase c : testing::law_loss_cases()) {
    // All of the gradient, on samples of the two kinds that the law cuts.
    for (std::int64_t& row : c.rows) row = row % 3 == 0 ? row + 1 : row;
    EXPECT_LE(testing::relative_error(gradient<double>(GetParam(), c), differences(GetParam(), c)),
              2e-8)
        << c.samples << " samples, " << c.state_caps << c.state_moduli;
  }
}

TEST_P(LawLossesOnIsa, FeaturesAndTheirGradient) {
  const auto& table = law_losses_table<double>(GetParam());
  const auto& baseline = law_losses_table<double>(Isa::baseline);
  for (const LawLossCase& c : testing::law_loss_cases()) {
    const std::size_t m = std::size_t(c.samples);
    std::vector<double> projection(3 * m), stress(6 * m), expected(3 * m), unused(6 * m);
    const auto at = [&](const std::vector<double>& log_e) {
      return SampleFeatures<double>{c.columns.data(), c.rows.data(), c.samples, std::exp(log_e[0])};
    };
    std::vector<double> of_projection, of_stress;
    for (std::size_t k = 0; k < 3 * m; ++k) of_projection.push_back(std::sin(double(k)));
    for (std::size_t k = 0; k < 6 * m; ++k) of_stress.push_back(std::cos(double(k)));
    const auto loss = [&](const std::vector<double>& log_e) {
      table.features(at(log_e), projection.data(), stress.data());
      double sum = 0;
      for (std::size_t k = 0; k < 3 * m; ++k) sum += of_projection[k] * projection[k];
      for (std::size_t k = 0; k < 6 * m; ++k) sum += of_stress[k] * stress[k];
      return sum;
    };
    const std::vector<double> log_e{-2.7};
    EXPECT_LE(testing::relative_error(
                  {table.features_adjoint(at(log_e), of_projection.data(), of_stress.data())},
                  testing::central_differences(loss, log_e, {1e-4})),
              2e-10);
    table.features(at(log_e), projection.data(), stress.data());
    baseline.features(at(log_e), expected.data(), unused.data());
    EXPECT_LE(testing::relative_error(projection, expected), 1e-15);
    EXPECT_LE(testing::relative_error(stress, unused), 1e-15);
  }
}

INSTANTIATE_TEST_SUITE_P(All, LawLossesOnIsa, ::testing::ValuesIn(available_isas()),
                         [](const auto& info) { return std::string(isa_name(info.param)); });

}  // namespace
}  // namespace uniphy::kernels
