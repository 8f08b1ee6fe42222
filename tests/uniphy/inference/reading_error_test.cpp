#include "uniphy/inference/reading_error.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "ops/base/torch.hpp"

namespace uniphy {
namespace {

/// Elastic laws that are 2 % too soft in shear.
class TooSoft : public FitVariables {
 public:
  int size() const override { return exact_->size(); }
  ops::RolloutBody body(const torch::Tensor& u, std::ptrdiff_t particles) const override {
    return exact_->body(u, particles);
  }
  torch::Tensor prior(const torch::Tensor&) const override { return {}; }
  int starts() const override { return exact_->starts(); }
  std::vector<double> start(int i) const override { return exact_->start(i); }
  std::string label(int i) const override { return exact_->label(i); }
  std::optional<kernels::LawDescription> origin(int i) const override {
    kernels::LawDescription law = FitVariables::law(start(i));
    law.mu *= 1.02;
    return law;
  }

 private:
  std::unique_ptr<const FitVariables> exact_ = make_analytic_variables(
      kernels::LawId::elastic, default_ranges(kernels::LawId::elastic), 50, 1);
};

TEST(ReadingError, IsWhatTheCodesOfAMaterialAreOffBy) {
  const TooSoft variables;
  const MaterialReading error = reading_error(variables, "elastic", 5e-4, 0.3);
  EXPECT_NEAR(error.mu, std::log(1.02), 1e-4);
  EXPECT_LT(error.lambda, 0.02);
  EXPECT_TRUE(std::isnan(error.viscosity));
  EXPECT_TRUE(std::isnan(reading_error(variables, "sand", 5e-4, 0.3).mu));
}

TEST(ReadingError, IsNotKnownOfAnAnalyticFit) {
  const auto variables = make_analytic_variables(kernels::LawId::elastic,
                                                 default_ranges(kernels::LawId::elastic), 5, 1);
  EXPECT_TRUE(std::isnan(reading_error(*variables, "elastic", 5e-4, 0.3).mu));
}

TEST(ReadingError, WidensTheIntervals) {
  MaterialBelief belief;
  belief.reading.mu = 100;
  belief.low.mu = 100 * std::exp(-0.03);
  belief.high.mu = 100 * std::exp(0.06);
  belief.reading.lambda = 5;
  belief.low.lambda = 4;
  belief.high.lambda = 6;
  MaterialReading error;
  error.mu = 0.04;
  const MaterialBelief wider = with_reading_error(belief, error);
  EXPECT_NEAR(wider.low.mu, 100 * std::exp(-0.05), 1e-9);
  EXPECT_NEAR(wider.high.mu, 100 * std::exp(std::hypot(0.06, 0.04)), 1e-9);
  EXPECT_EQ(wider.low.lambda, 4);  // of which no error is known
  EXPECT_TRUE(std::isnan(wider.low.viscosity));
  // A value beyond what was drawn is in its interval.
  belief.reading.mu = 200;
  EXPECT_GT(with_reading_error(belief, error).high.mu, 200);
}

}  // namespace
}  // namespace uniphy
