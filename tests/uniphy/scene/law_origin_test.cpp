#include "uniphy/scene/law_origin.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/published_return.hpp"
#include "uniphy/io/model_file.hpp"

namespace uniphy {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const ModelFile& shipped() {
  static const ModelFile model =
      read_model(std::string(UNIPHY_SOURCE_DIR) + "/models/pretrained/unified.h5");
  return model;
}

kernels::LawDescription code(std::int64_t i) {
  kernels::LawDescription law;
  law.id = kernels::LawId::learned;
  law.weights = std::make_shared<kernels::LearnedLawWeights>(shipped().weights);
  law.z = shipped().code(i);
  return law;
}

/// The published form with F_proj = F − part (F − I).
kernels::LawDescription returning(double part) {
  kernels::LawDescription law;
  law.id = kernels::LawId::learned;
  law.weights = std::make_shared<kernels::LearnedLawWeights>(testing::published_return(part, 1));
  law.z = {0};
  return law;
}

TEST(LawOrigin, OnlyThePublishedFormFlowsBySteps) {
  EXPECT_TRUE(flows_by_steps(returning(0.1)));
  EXPECT_FALSE(flows_by_steps(returning(0)));
  EXPECT_FALSE(flows_by_steps(returning(1)));  // arrives at once
  for (std::int64_t i = 0; i < shipped().codes(); ++i) EXPECT_FALSE(flows_by_steps(code(i)));
}

TEST(LawOrigin, TheShippedModelKnowsItsTimeSteps) {
  // 1/4800 s, but for a stiff sand whose data set lowered it.
  EXPECT_EQ(shipped().training_dt, (std::array<double, 2>{1.9e-4, 1.0 / 4800}));
}

TEST(LawOrigin, TimeStepsAreJudgedByWhatDependsOnThem) {
  const LawOrigin trained{LawOrigin::Kind::trained, shipped().training_dt};
  const auto viscous = returning(0.1), elastic = code(0);
  EXPECT_THAT(time_step_warning(viscous, trained, 5e-4).value_or("nothing"),
              AllOf(HasSubstr("trained at a time step of 0.000208 s"),
                    HasSubstr("here dt is 0.0005 s"), HasSubstr("2.4 times as large")));
  EXPECT_THAT(time_step_warning(viscous, trained, 9.5e-5).value_or("nothing"),
              HasSubstr("0.5 times as large"));
  EXPECT_FALSE(time_step_warning(viscous, trained, 1.0 / 4800));
  EXPECT_FALSE(time_step_warning(viscous, trained, 2e-4));
  EXPECT_FALSE(time_step_warning(elastic, trained, 5e-4));
  EXPECT_FALSE(time_step_warning(viscous, {LawOrigin::Kind::trained}, 5e-4));  // not known

  LawOrigin fitted{LawOrigin::Kind::fitted, {4e-4, 4e-4}};
  for (const auto& law : {elastic, kernels::LawDescription{}}) {
    EXPECT_FALSE(time_step_warning(law, fitted, 2e-4));
    EXPECT_FALSE(time_step_warning(law, fitted, 8e-4));
    EXPECT_THAT(time_step_warning(law, fitted, 1.9e-4).value_or("nothing"),
                AllOf(HasSubstr("fitted at a time step of 0.0004 s"),
                      HasSubstr("here dt is 0.00019 s"), HasSubstr("transfer")));
  }
  EXPECT_THAT(time_step_warning(viscous, fitted, 3e-4).value_or("nothing"),
              HasSubstr("0.75 times as large"));
  EXPECT_FALSE(time_step_warning({}, {}, 1e-3));  // parameters of the user's own
}

}  // namespace
}  // namespace uniphy
