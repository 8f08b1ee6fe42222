// The checks must see what they are there for: the analytic laws pass, a law that is wrong fails.

#include "uniphy/evaluation/law_checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/random_weights.hpp"
#include "tests/uniphy/evaluation/small_run.hpp"
#include "uniphy/data/drawn_states.hpp"
#include "uniphy/data/law_branches.hpp"
#include "uniphy/data/material_ranges.hpp"

namespace uniphy {
namespace {

kernels::LawDescription law_of(std::size_t material) {
  return material_at(default_material_ranges()[material], {0.5, 0.5, 0.3, 0.5, 0.5});
}

/// Drawn states of every branch of every material, those exactly at rest among them.
Dataset drawn_data(std::vector<kernels::LawDescription>& laws) {
  Dataset data;
  data.first = {0};
  UniformRandom random(3);
  for (std::size_t m = 0; m < default_material_ranges().size(); ++m) {
    const kernels::LawDescription law = law_of(m);
    TrajectoryRecord record;
    record.material = kernels::law_name(law.id);
    record.dt = 1.0 / 4800;
    for (std::size_t branch = 0; branch < branch_names(law.id).size(); ++branch) {
      const DrawnStateRanges ranges;
      if (!branch_reachable(law, record.dt, static_cast<int>(branch), ranges)) continue;
      const LawSamples s =
          draw_states(law, record.dt, static_cast<int>(branch), 40, ranges, random);
      for (const auto& [from, to] : {std::pair{&s.F, &data.samples.F},
                                     {&s.F_proj, &data.samples.F_proj},
                                     {&s.C, &data.samples.C},
                                     {&s.tau, &data.samples.tau}}) {
        to->insert(to->end(), from->begin(), from->end());
      }
    }
    data.trajectories.push_back(record);
    data.first.push_back(data.samples.size());
    laws.push_back(law);
  }
  return data;
}

kernels::LawDescription random_law(kernels::LawForm form) {
  kernels::LawDescription law;
  law.id = kernels::LawId::learned;
  law.weights = std::make_shared<kernels::LearnedLawWeights>(
      testing::random_weights(form, 4, 8, 1, kernels::Activation::silu, 5));
  law.z.assign(4, 0.1);
  return law;
}

TEST(FrameIndifference, HoldsForTheAnalyticLaws) {
  std::vector<kernels::LawDescription> laws;
  const Dataset data = drawn_data(laws);
  ASSERT_EQ(laws.size(), 5u);
  ASSERT_GT(data.samples.size(), 500);
  const FrameIndifference error = frame_indifference(data, laws, 1);
  EXPECT_GT(error.stress, 0);
  EXPECT_LT(error.stress, 1e-7);
  EXPECT_GT(error.projection, 0);
  EXPECT_LT(error.projection, 1e-12);
}

TEST(FrameIndifference, IsMissedByAPlainNetworkAndNotByAnIsotropicOne) {
  std::vector<kernels::LawDescription> laws;
  const Dataset data = drawn_data(laws);
  laws.assign(laws.size(), random_law(kernels::LawForm::isotropic));
  const FrameIndifference isotropic = frame_indifference(data, laws, 1);
  EXPECT_LT(isotropic.stress, 1e-7);
  EXPECT_LT(isotropic.projection, 1e-12);
  // One plain network among them is enough.
  laws[2] = random_law(kernels::LawForm::published);
  const FrameIndifference published = frame_indifference(data, laws, 1);
  EXPECT_GT(published.stress, 1e-2);
  EXPECT_GT(published.projection, 1e-2);
}

TEST(FrameIndifference, KeepsWhatIsNotANumber) {
  FrameIndifference worst{1, 2};
  worst.include({3, 1});
  EXPECT_EQ(worst.stress, 3);
  EXPECT_EQ(worst.projection, 2);
  worst.include({std::nan(""), 5});
  worst.include({7, 6});
  EXPECT_TRUE(std::isnan(worst.stress));
  EXPECT_EQ(worst.projection, 6);
}

TEST(RestDrift, IsNoneForTheAnalyticLaws) {
  std::vector<kernels::LawDescription> laws;
  for (std::size_t m = 0; m < default_material_ranges().size(); ++m) laws.push_back(law_of(m));
  RestOptions options;
  options.steps = 50;
  options.particles = 27;
  for (const double drift : rest_drifts(laws, options)) EXPECT_LT(drift, 1e-12);
}

TEST(RestDrift, ShowsALawThatPushesAndOneThatBursts) {
  RestOptions options;
  options.steps = 20;
  options.particles = 27;
  kernels::LawDescription pushes = random_law(kernels::LawForm::published), bursts = pushes;
  pushes.z[0] = -2;  // 25 Pa
  bursts.z[0] = 5;   // 1e10 Pa
  ::testing::internal::CaptureStderr();
  const std::vector<double> drifts =
      rest_drifts({random_law(kernels::LawForm::isotropic), pushes, bursts}, options);
  const std::string log = ::testing::internal::GetCapturedStderr();
  EXPECT_LT(drifts[0], 1e-12);
  EXPECT_GT(drifts[1], 1e-6);
  EXPECT_LT(drifts[1], 1);
  EXPECT_EQ(drifts[2], 1);
  EXPECT_THAT(log, ::testing::HasSubstr("at rest, code 2: "));
}

}  // namespace
}  // namespace uniphy
