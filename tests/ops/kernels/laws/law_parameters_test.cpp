// The one table of law parameters, and each law's view of it.

#include "ops/kernels/laws/law_parameters.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "ops/kernels/laws/analytic_law.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/law_cases.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::testing {
namespace {

using kernels::LawDescription;
using kernels::LawId;
using kernels::LawParameter;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> names(LawId id) {
  std::vector<std::string> all;
  for (const LawParameter& p : kernels::law_parameters(id)) all.emplace_back(p.name);
  return all;
}

TEST(LawParameters, StandAtTheirPlacesInEveryForm) {
  LawDescription law;
  double value = 1;
  for (const LawParameter& p : kernels::kLawParameterTable) law.*p.member = value++;
  EXPECT_EQ(law.mu, 1);
  EXPECT_EQ(law.lambda, 2);
  EXPECT_EQ(law.tau_y, 3);
  EXPECT_EQ(law.theta, 4);
  EXPECT_EQ(law.eta, 5);
  const auto packed = kernels::kernel_parameters<float>(law);
  for (int i = 0; i < kernels::kLawParameters; ++i) {
    EXPECT_EQ(kernels::kLawParameterTable[i].place, i);
    EXPECT_EQ(packed.*kernels::kLawParameterMembers<float>[i], float(i + 1));
  }
  EXPECT_EQ(packed.theta, 4);
}

TEST(LawParameters, AreThoseOfTheLaw) {
  EXPECT_THAT(names(LawId::elastic), ElementsAre("mu", "lambda"));
  EXPECT_THAT(names(LawId::plasticine), ElementsAre("mu", "lambda", "tau_y"));
  EXPECT_THAT(names(LawId::sand), ElementsAre("mu", "lambda", "theta"));
  EXPECT_THAT(names(LawId::non_newtonian), ElementsAre("mu", "lambda", "tau_y", "eta"));
  EXPECT_THAT(names(LawId::water), ElementsAre("lambda"));
  EXPECT_THAT(names(LawId::mooney_rivlin), ElementsAre("lambda", "c1", "c2"));
  EXPECT_THAT(names(LawId::carreau), ElementsAre("lambda", "eta", "eta_inf", "kappa", "n"));
  EXPECT_THAT(names(LawId::cohesive_sand), ElementsAre("mu", "lambda", "theta", "cohesion"));
  EXPECT_THAT(names(LawId::herschel_bulkley), ElementsAre("mu", "lambda", "tau_y", "eta", "n"));
  EXPECT_THAT(names(LawId::learned), ElementsAre());
  EXPECT_STREQ(kernels::law_parameters(LawId::elastic)[0].unit, "Pa");
  EXPECT_STREQ(kernels::law_parameters(LawId::newtonian)[0].unit, "Pa s");
  EXPECT_STREQ(kernels::law_parameters(LawId::water)[0].text, "bulk modulus");
}

TEST(LawParameters, ValuesGoBothWays) {
  for (const LawId id : analytic_laws()) {
    const LawDescription law = sample_law(id);
    std::vector<double> values = kernels::parameter_values(law);
    ASSERT_EQ(std::ptrdiff_t(values.size()), kernels::parameter_count(law));
    for (double& v : values) v *= 2;
    const LawDescription twice = kernels::with_parameters(law, values.data());
    for (const LawParameter& p : kernels::law_parameters(id))
      EXPECT_EQ(twice.*p.member, 2 * law.*p.member) << p.name;
    EXPECT_EQ(kernels::parameter_values(twice), values);
  }
}

TEST(LawParameters, OfALearnedLawAreItsLatent) {
  LawDescription law;
  law.id = LawId::learned;
  law.weights = std::make_shared<kernels::LearnedLawWeights>(
      random_weights(kernels::LawForm::isotropic, 3, 8, 1, kernels::Activation::silu, 1));
  EXPECT_EQ(kernels::parameter_count(law), 3);
  const double z[] = {0.5, -1, 2};
  EXPECT_THAT(kernels::parameter_values(kernels::with_parameters(law, z)), ElementsAre(0.5, -1, 2));
}

// Every end of every range, on either side.
TEST(LawParameters, RangesAreChecked) {
  for (const LawId id : analytic_laws()) {
    for (const LawParameter& p : kernels::law_parameters(id)) {
      const auto check = [&](double value) {
        LawDescription law = sample_law(id);
        law.*p.member = value;
        kernels::check_parameters(law);
      };
      EXPECT_NO_THROW(check(1e-300)) << p.name;
      std::vector<double> bad{-1e-300, std::nan(""), double(INFINITY)};
      if (p.positive)
        bad.push_back(0);
      else
        EXPECT_NO_THROW(check(0)) << p.name;
      if (std::isfinite(p.below)) {
        EXPECT_NO_THROW(check(std::nextafter(p.below, 0))) << p.name;
        bad.push_back(p.below);
      }
      for (const double value : bad) {
        EXPECT_THAT(error_of([&] { check(value); }),
                    HasSubstr(std::string("parameter ") + p.name + ": expected a finite"))
            << value;
      }
    }
  }
  LawDescription learned;
  learned.id = LawId::learned;
  EXPECT_THAT(error_of([&] { kernels::check_parameters(learned); }), HasSubstr("latent code"));
}

}  // namespace
}  // namespace uniphy::testing
