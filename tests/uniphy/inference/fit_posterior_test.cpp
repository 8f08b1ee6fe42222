// The posterior of a fit: against what is known where residuals are linear, and where they are not.

#include "uniphy/inference/fit_posterior.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "ops/base/torch.hpp"
#include "tests/support/on_threads.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr int kRows = 400;

Tensor normal_rows(std::mt19937& random, double spread) {
  std::normal_distribution<double> noise(0, spread);
  Tensor rows = torch::empty({kRows}, torch::kFloat64);
  for (int i = 0; i < kRows; ++i) rows.data_ptr<double>()[i] = noise(random);
  return rows;
}

/// Of a straight line a + b t through kRows values; the third number moves nothing.
Tensor line(const Tensor& u) {
  const Tensor t = torch::linspace(-1, 1, kRows, torch::kFloat64);
  return u[0] + u[1] * t;
}

/// Residuals of the line whose squares sum to the mean square of the values.
Residuals line_through(const Tensor& values) {
  return [values](const Tensor& u) { return (line(u) - values) / std::sqrt(double(kRows)); };
}

Tensor least_squares_line(const Tensor& values) {
  const Tensor t = torch::linspace(-1, 1, kRows, torch::kFloat64);
  return torch::stack(
      {values.mean(), (values * t).sum() / t.square().sum(), torch::zeros({}, torch::kFloat64)});
}

TEST(FitPosterior, OfALineIsThatOfTheTextbook) {
  std::mt19937 random(3);
  const Tensor values = normal_rows(random, 0.02);
  PosteriorOptions options;
  options.samples = 800;
  const FitPosterior found =
      fit_posterior(line_through(values), least_squares_line(values), {0, 1, 2}, 0, kRows, options);
  ASSERT_EQ(found.spread.size(), 3u);
  EXPECT_EQ(found.determined, 2);
  EXPECT_LT(found.dispersion, 2);
  const double of_mean = 0.02 / std::sqrt(kRows) * std::sqrt(found.dispersion);
  EXPECT_NEAR(found.spread[0], of_mean, 0.1 * of_mean);
  EXPECT_NEAR(found.spread[1], std::sqrt(3) * of_mean, 0.1 * std::sqrt(3) * of_mean);
  EXPECT_NEAR(found.spread[2], 1, 1e-9);  // the prior alone
  ASSERT_EQ(found.samples.size(), 800u);
  const Tensor samples = torch::stack(found.samples);
  for (int k = 0; k < 3; ++k) {
    const double spread = samples.select(1, k).std().item<double>();
    EXPECT_NEAR(spread, found.spread[k], 0.15 * found.spread[k]) << k;
  }
}

TEST(FitPosterior, IntervalsHoldTheTruth) {
  std::mt19937 random(5);
  int held = 0;
  constexpr int kDraws = 200;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Tensor values = normal_rows(random, 0.02);  // about the line 0
    PosteriorOptions options;
    options.samples = 0;
    const Tensor best = least_squares_line(values);
    const FitPosterior found = fit_posterior(line_through(values), best, {0, 1}, 0, kRows, options);
    held += std::abs(best[0].item<double>()) < 1.645 * found.spread[0] ? 1 : 0;
  }
  EXPECT_GE(held, 0.85 * kDraws);
  EXPECT_LE(held, 0.98 * kDraws);
}

/// Errors that are alike for a tenth of the time: ten numbers and not kRows.
TEST(FitPosterior, ErrorsThatLastAreNotIndependent) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.02);
  int held = 0;
  constexpr int kDraws = 200;
  for (int draw = 0; draw < kDraws; ++draw) {
    Tensor values = torch::empty({kRows}, torch::kFloat64);
    for (int w = 0; w < 10; ++w)
      values.slice(0, w * kRows / 10, (w + 1) * kRows / 10) = noise(random);
    PosteriorOptions options;
    options.samples = 0;
    const Tensor best = least_squares_line(values);
    const FitPosterior found = fit_posterior(line_through(values), best, {0, 1}, 0, kRows, options);
    EXPECT_GT(found.dispersion, 5);
    held += std::abs(best[0].item<double>()) < 1.645 * found.spread[0] ? 1 : 0;
  }
  EXPECT_GE(held, 0.75 * kDraws);
}

/// A number that moves nothing on one side of the point, and much on the other: no slope shows it.
Tensor one_sided(const Tensor& u) {
  const Tensor over = (u[0] - 0.1).clamp_min(0);
  return torch::stack({over, u[1] - 0.01, u[1] + 0.01});
}

TEST(FitPosterior, SamplesKeepToWhatTheResidualsAllow) {
  PosteriorOptions options;
  options.samples = 400;
  const FitPosterior found =
      fit_posterior(one_sided, torch::zeros({2}, torch::kFloat64), {0, 1}, 0, 3, options);
  EXPECT_EQ(found.determined, 1);
  const Tensor u = torch::stack(found.samples).select(1, 0);
  EXPECT_LT(u.max().item<double>(), 0.2);  // 1 without a look at the residuals
  EXPECT_LT(u.min().item<double>(), -1.5);
}

TEST(FitPosterior, WhatNothingMovesIsNotDetermined) {
  const auto still = [](const Tensor&) { return torch::full({30}, 1e-4, torch::kFloat64); };
  const FitPosterior found =
      fit_posterior(still, torch::zeros({2}, torch::kFloat64), {0, 1}, 0, 30, {});
  EXPECT_EQ(found.determined, 0);
  EXPECT_EQ(found.spread, (std::vector<double>{1, 1}));
}

TEST(FitPosterior, WithoutARollOutThereIsNone) {
  const auto fails = [](const Tensor&) { return Tensor(); };
  EXPECT_TRUE(
      fit_posterior(fails, torch::zeros({2}, torch::kFloat64), {0, 1}, 0, 30, {}).spread.empty());
}

TEST(FitPosterior, TheSameBitsOnOneThreadAndOnTwo) {
  // Large enough for a product of matrices to be done by several threads.
  constexpr int kMany = 20000;
  const Tensor t = torch::linspace(-1, 1, kMany, torch::kFloat64);
  const auto curve = [t](const Tensor& u) {
    Tensor r = 1e-3 * (40 * t).sin();
    for (int k = 0; k < 8; ++k) r = r + u[k] * t.pow(k);
    return r / std::sqrt(double(kMany));
  };
  const auto samples = [&] {
    const Tensor point = torch::zeros({8}, torch::kFloat64);
    return torch::stack(
        fit_posterior(curve, point, {0, 1, 2, 3, 4, 5, 6, 7}, 0, kMany, {}).samples);
  };
  EXPECT_TRUE(testing::on_threads(1, samples).equal(testing::on_threads(2, samples)));
}

}  // namespace
}  // namespace uniphy
