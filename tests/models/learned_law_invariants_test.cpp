// What every law must satisfy, for learned ones; and the isotropic form with caps and coefficients
// set by hand, where it is an analytic law.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/learned/power_law.hpp"
#include "tests/support/law_cases.hpp"
#include "tests/support/law_invariants.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::testing {
namespace {

using kernels::Activation;
using kernels::LawDescription;
using kernels::LawForm;
using kernels::LawId;
using kernels::LearnedLawWeights;
using kernels::MlpWeights;

LawDescription described(LearnedLawWeights weights, std::vector<double> z) {
  LawDescription d;
  d.id = LawId::learned;
  d.weights = std::make_shared<const LearnedLawWeights>(std::move(weights));
  d.z = std::move(z);
  return d;
}

/// One linear layer.
MlpWeights linear(int in, std::vector<double> bias) {
  MlpWeights::Layer layer;
  layer.in = in;
  layer.out = int(bias.size());
  layer.weight.assign(std::size_t(in) * bias.size(), 0.0);
  layer.bias = std::move(bias);
  return {{layer}};
}

LawDescription analytic(LawId id, double lambda, double mu = 0) {
  LawDescription d;
  d.id = id;
  d.mu = mu;
  d.lambda = lambda;
  return d;
}

constexpr double kWholeWay = 0;  ///< η̃ of a law that returns to its cap at once
constexpr double kStrainOverStress = kernels::kStrainScale / kernels::kStressScale;

/// The isotropic form of the StVK-Hencky solid τ = 2μ ε + λ tr ε, with the caps c₁ + slope t/e and
/// c₂ and the viscosity η̃.
LearnedLawWeights hencky_solid(double mu, double lambda, double c1, double c2, double slope = 0,
                               double viscosity = kWholeWay) {
  LearnedLawWeights w;
  w.form = LawForm::isotropic;
  w.latent_size = 2;  // z = 0: the scales are their constants
  w.projection = linear(3 + 2, {c1, c2, std::asinh(slope), viscosity, 0});
  w.stress = linear(6 + 2, std::vector<double>(kernels::kStressOutputs, 0.0));
  std::vector<double>& outputs = w.stress.layers[0].bias;
  outputs[kernels::kBulk] = std::asinh(lambda * kStrainOverStress);
  outputs[kernels::kShear] = std::asinh(2 * mu * kStrainOverStress);
  return w;
}
/// λ J(J − 1) = λ exp(3t/2) 2 sinh(t/2) and no shear stress, in its place.
std::vector<double>& with_liquid_volume(LearnedLawWeights& w) {
  std::vector<double>& outputs = w.stress.layers[0].bias;
  outputs[kernels::kVolumeGamma] = 0.5;
  outputs[kernels::kVolumeDelta] = 1.5;
  outputs[kernels::kShear] = 0;
  return outputs;
}

TEST(LearnedLawInvariants, OfRandomIsotropicLaws) {
  for (const Activation activation : {Activation::gelu, Activation::silu, Activation::squareplus}) {
    for (const unsigned seed : {1u, 2u, 3u}) {
      SCOPED_TRACE(std::string(kernels::activation_name(activation)) + " " + std::to_string(seed));
      const auto law = kernels::make_law<double>(
          described(random_weights(LawForm::isotropic, 6, 24, 2, activation, seed),
                    {0.5, 0.3, -0.2, 0.4, 0.1, -0.6}));
      LawPromises promises;
      promises.idempotent = promises.dissipative = false;  // nothing makes an untrained law so
      promises.tolerance = 1e-11;
      // Where c₁ ≤ 0 the law is a fluid at that state and forgets the rotation.
      expect_rest(*law, 1e-4, promises);
      expect_projection(*law, 1e-4, promises);
      expect_finite(*law, 1e-4);
      expect_independent_lanes(*law, 1e-4);
      expect_frame_indifference(*law, 1e-4, promises);
    }
  }
}

TEST(LearnedLawInvariants, OfRandomSeedLaws) {
  // The published form promises none of the physics, only sound numbers.
  const auto law = kernels::make_law<double>(
      described(random_weights(LawForm::published, 6, 24, 2, Activation::gelu, 1),
                {0.5, 0.3, -0.2, 0.4, 0.1, -0.6}));
  expect_finite(*law, 1e-4);
  expect_independent_lanes(*law, 1e-4);
}

TEST(LearnedLawInvariants, OfAnElasticLaw) {
  const auto law = kernels::make_law<double>(described(hencky_solid(1e5, 2e5, 1e6, 1e6), {0, 0}));
  LawPromises promises;
  promises.elastic = true;
  expect_law_invariants(*law, 1e-4, promises);
}

TEST(LearnedLawInvariants, OfAPlasticLaw) {
  const auto law = kernels::make_law<double>(described(hencky_solid(1e5, 2e5, 0.7, 1e6), {0, 0}));
  expect_law_invariants(*law, 1e-4, {});
}

struct Largest {
  double projection = 0, stress = 0;
};
Largest difference(const kernels::LawKernel<double>& a, const kernels::LawKernel<double>& b,
                   double dt = 1e-4) {
  Largest largest;
  std::mt19937_64 random(3);
  for (const Matrix& F : sound_deformations(400)) {
    const Matrix C = random_matrix(random, 10);
    const LawState x = apply_law(a, dt, F, C), y = apply_law(b, dt, F, C);
    largest.projection = std::max(largest.projection, norm(x.F_proj - y.F_proj) / norm(y.F_proj));
    largest.stress = std::max(largest.stress, norm(x.tau - y.tau) / std::max(norm(y.tau), 1e3));
  }
  return largest;
}

TEST(LearnedLaw, WithAConstantCapIsPlasticine) {
  const double mu = 1e5, lambda = 2e5, tau_y = 7e3;
  const auto learned = kernels::make_law<double>(
      described(hencky_solid(mu, lambda, tau_y / (2 * mu) / kernels::kStrainScale, 1e6), {0, 0}));
  LawDescription d = analytic(LawId::plasticine, lambda, mu);
  d.tau_y = tau_y;
  const Largest largest = difference(*learned, *kernels::make_law<double>(d));
  EXPECT_LE(largest.projection, 2e-15);
  EXPECT_LE(largest.stress, 1e-13);
}

TEST(LearnedLaw, WithACapLinearInTheTraceIsSand) {
  const double mu = 1e5, lambda = 2e5, theta = 0.35;
  const double alpha = std::sqrt(2.0 / 3) * 2 * std::sin(theta) / (3 - std::sin(theta));
  const double slope = -alpha * (3 * lambda + 2 * mu) / (2 * mu);
  const auto learned =
      kernels::make_law<double>(described(hencky_solid(mu, lambda, 0, 0, slope), {0, 0}));
  LawDescription d = analytic(LawId::sand, lambda, mu);
  d.theta = theta;
  const Largest largest = difference(*learned, *kernels::make_law<double>(d));
  EXPECT_LE(largest.projection, 2e-15);
  EXPECT_LE(largest.stress, 8e-13);
}

TEST(LearnedLaw, WithACapAndARateIsNonNewtonian) {
  const double mu = 1e5, lambda = 2e5, tau_y = 7e3, eta = 30;
  const double cap = tau_y / (2 * mu) / kernels::kStrainScale;
  const auto learned = kernels::make_law<double>(described(
      hencky_solid(mu, lambda, cap, 1e6, 0, std::asinh(eta / (2 * mu * kernels::kFlowStep))),
      {0, 0}));
  LawDescription d = analytic(LawId::non_newtonian, lambda, mu);
  d.tau_y = tau_y;
  d.eta = eta;
  const Largest largest = difference(*learned, *kernels::make_law<double>(d));
  EXPECT_LE(largest.projection, 2e-15);
  EXPECT_LE(largest.stress, 1e-13);
}

TEST(LearnedLaw, WithGreensMeasureIsNeoHookean) {
  const double mu = 1e5, lambda = 2e5;
  auto weights = hencky_solid(mu, lambda, 1e6, 1e6);
  weights.stress.layers[0].bias[kernels::kShearExponent] = 2;
  const LawDescription d = analytic(LawId::elastic, lambda, mu);
  const Largest largest = difference(*kernels::make_law<double>(described(weights, {0, 0})),
                                     *kernels::make_law<double>(d));
  EXPECT_EQ(largest.projection, 0);
  EXPECT_LE(largest.stress, 1e-11);
}

TEST(LearnedLaw, WithTheLiquidsExponentsIsNewtonian) {
  const double mu = 300, lambda = 1e4, kappa = 2.0 / 3 * mu + lambda;
  auto weights = hencky_solid(0, 7 * kappa, -1, 1e6);
  auto& outputs = weights.stress.layers[0].bias;
  outputs[kernels::kViscosity] = std::asinh(mu / (kernels::kStressScale * kernels::kTimeScale));
  outputs[kernels::kVolumeGamma] = 3.5;
  outputs[kernels::kVolumeDelta] = -2.5;
  const LawDescription d = analytic(LawId::newtonian, lambda, mu);
  const Largest largest = difference(*kernels::make_law<double>(described(weights, {0, 0})),
                                     *kernels::make_law<double>(d));
  EXPECT_LE(largest.projection, 6e-15);
  EXPECT_LE(largest.stress, 5e-13);
}

TEST(LearnedLaw, ACodeServesAnyTimeStep) {
  const double mu = 1e5, lambda = 2e5, tau_y = 7e3, eta = 30;
  const double cap = tau_y / (2 * mu) / kernels::kStrainScale;
  const auto learned = kernels::make_law<double>(described(
      hencky_solid(mu, lambda, cap, 1e6, 0, std::asinh(eta / (2 * mu * kernels::kFlowStep))),
      {0, 0}));
  LawDescription d = analytic(LawId::non_newtonian, lambda, mu);
  d.tau_y = tau_y;
  d.eta = eta;
  for (const double dt : {1e-5, 2e-4, 1e-3}) {
    const Largest largest = difference(*learned, *kernels::make_law<double>(d), dt);
    EXPECT_LE(largest.projection, 2e-15) << dt;
    EXPECT_LE(largest.stress, 1e-13) << dt;
  }
}

// Laws that the form was not made for, and holds.

TEST(LearnedLaw, WithTwoMeasuresIsFixedCorotated) {
  const double mu = 1e5, lambda = 2e5;  // 2μ(σ² − σ) = 4μ m(ε; 2) − 2μ m(ε; 1)
  auto weights = hencky_solid(mu, lambda, 1e6, 1e6);
  std::vector<double>& outputs = with_liquid_volume(weights);
  outputs[kernels::kShear] = std::asinh(4 * mu * kStrainOverStress);
  outputs[kernels::kShearExponent] = 2;
  outputs[kernels::kSecondShear] = std::asinh(-2 * mu * kStrainOverStress);
  outputs[kernels::kSecondExponent] = 1;
  const LawDescription d = analytic(LawId::fixed_corotated, lambda, mu);
  const Largest largest = difference(*kernels::make_law<double>(described(weights, {0, 0})),
                                     *kernels::make_law<double>(d));
  EXPECT_EQ(largest.projection, 0);
  EXPECT_LE(largest.stress, 1e-11);
}

TEST(LearnedLaw, WithTwoIsochoricMeasuresIsMooneyRivlin) {
  // dev(2c₁ B̄ + 2c₂ (tr(B̄) B̄ − B̄²)) = 4c₁ dev m(ε̂; 2) + 4c₂ dev m(ε̂; −2), by Cayley and Hamilton.
  const double c1 = 3e4, c2 = 1e4, lambda = 2e5;
  auto weights = hencky_solid(0, lambda, 1e6, 1e6);
  std::vector<double>& outputs = with_liquid_volume(weights);
  outputs[kernels::kShear] = std::asinh(4 * c1 * kStrainOverStress);
  outputs[kernels::kShearExponent] = 2;
  outputs[kernels::kSecondShear] = std::asinh(4 * c2 * kStrainOverStress);
  outputs[kernels::kSecondExponent] = -2;
  outputs[kernels::kIsochoricShare] = 1;
  LawDescription d = analytic(LawId::mooney_rivlin, lambda);
  d.c1 = c1;
  d.c2 = c2;
  const Largest largest = difference(*kernels::make_law<double>(described(weights, {0, 0})),
                                     *kernels::make_law<double>(d));
  EXPECT_EQ(largest.projection, 0);
  EXPECT_LE(largest.stress, 1e-11);
}

TEST(LearnedLaw, WithARateIsCarreau) {
  const double lambda = 1e5, eta = 300, eta_inf = 5, kappa = 0.5, n = 0.4;
  auto weights = hencky_solid(0, lambda, -1, 1e6);
  std::vector<double>& outputs = with_liquid_volume(weights);
  const auto viscosity = [](double x) {
    return std::asinh(2 * x / (kernels::kStressScale * kernels::kTimeScale));
  };
  outputs[kernels::kViscosity] = viscosity(eta_inf);
  outputs[kernels::kBulkRateShare] = 1;
  outputs[kernels::kRateViscosity] = viscosity(eta - eta_inf);
  outputs[kernels::kRateScale] = std::log(std::sqrt(2) * kappa / kernels::kTimeScale);
  outputs[kernels::kRateExponent] = (n - 1) / 2;
  LawDescription d = analytic(LawId::carreau, lambda);
  d.eta = eta;
  d.eta_inf = eta_inf;
  d.kappa = kappa;
  d.n = n;
  const Largest largest = difference(*kernels::make_law<double>(described(weights, {0, 0})),
                                     *kernels::make_law<double>(d));
  EXPECT_LE(largest.projection, 6e-15);
  EXPECT_LE(largest.stress, 1e-11);
}

TEST(LearnedLaw, WithAPowerOfTheExcessIsHerschelBulkley) {
  const double mu = 1e5, lambda = 2e5, tau_y = 2e3, eta = 20, e = kernels::kStrainScale;
  for (const double n : {0.6, 1.7}) {
    // ‖s‖ = 2μ e (c + y): 2μ e y + 2μ Δt (2μ e y/η)^{1/n} = 2μ e x, so that at Δt₀
    // B = (Δt₀/e) (2μ e/η)^{1/n} = ((1 + v)/x₀)^{p−1}/vᵖ, which v solves.
    const double p = 1 / n, log_x0 = std::log(kernels::kFlowExcess);
    const double log_B = std::log(kernels::kFlowStep / e) + p * std::log(2 * mu * e / eta);
    double v = 1;
    for (int i = 0; i < 500; ++i)
      v *= std::exp(-0.2 * (log_B - (p - 1) * (std::log1p(v) - log_x0) + p * std::log(v)));
    auto weights = hencky_solid(mu, lambda, tau_y / (2 * mu) / e, 1e6, 0, std::asinh(v));
    weights.projection.layers[0].bias[kernels::kFlowExponent] =
        kernels::kFlowPowerLimit * std::atanh(std::log(p) / kernels::kFlowPowerLimit);
    LawDescription d = analytic(LawId::herschel_bulkley, lambda, mu);
    d.tau_y = tau_y;
    d.eta = eta;
    d.n = n;
    const Largest largest = difference(*kernels::make_law<double>(described(weights, {0, 0})),
                                       *kernels::make_law<double>(d));
    // Up to b̄ = tr(Σ²)/3, which that law does not have.
    EXPECT_LE(largest.projection, 0.05) << n;
  }
}

}  // namespace
}  // namespace uniphy::testing
