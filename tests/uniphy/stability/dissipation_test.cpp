#include "uniphy/stability/dissipation.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/uniphy/stability/stability_cases.hpp"
#include "uniphy/stability/subjects.hpp"

namespace uniphy::stability {
namespace {

TEST(Dissipation, AnalyticAndTrainedLawsTakeEnergyOutAndARandomNetworkDoesNot) {
  StabilityOptions o;
  o.model = testing::shipped_model();
  const Subjects subjects = load_subjects(o);
  ASSERT_EQ(subjects.materials.size(), 5u);
  for (const Subject& s : subjects.materials) {
    const auto least = [](const kernels::LawDescription& law) {
      const Dissipation d = least_dissipation(law, 100, 1);
      return std::min(d.plastic, d.viscous);
    };
    EXPECT_GT(least(s.analytic), -1e-12) << s.material;
    EXPECT_GT(least(s.isotropic), -kDissipationTolerance) << s.material;
    EXPECT_LT(least(s.published), -kDissipationTolerance) << s.material;
  }
}

TEST(Dissipation, IsThatOfTheClosedForm) {
  // A fluid: the viscous part is μ D : D, the plastic one 0.
  kernels::LawDescription law = testing::elastic_law(100, 1e4);
  law.id = kernels::LawId::newtonian;
  const Dissipation d = least_dissipation(law, 50, 3);
  EXPECT_GT(d.viscous, 0);
  EXPECT_NEAR(d.plastic, 0, 1e-12);
  // Most of these states are beyond the yield stress: flow takes work out of each.
  EXPECT_GT(least_dissipation(testing::plasticine_law(), 50, 3).plastic, 1e-6);
}

}  // namespace
}  // namespace uniphy::stability
