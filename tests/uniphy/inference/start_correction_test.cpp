#include "uniphy/inference/start_correction.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "ops/base/torch.hpp"
#include "tests/uniphy/inference/observed_scene.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/data/laboratory_view.hpp"
#include "uniphy/inference/infer_run.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;
using torch::Tensor;

TEST(StartCorrection, FindsAStartFromThePathAndTakesItOut) {
  torch::manual_seed(1);
  const Tensor G =
      torch::eye(3, torch::kFloat64) + 0.3 * torch::randn({6, 4, 3, 3}, torch::kFloat64);
  const Tensor delta = 0.01 * torch::randn({4, 3}, torch::kFloat64);
  // Paths that are seen where the starts δ lead, of a roll-out that begins without them.
  Tensor r = -torch::matmul(G, delta.view({1, 4, 3, 1})).reshape({6, 12});
  const StartCorrection all(G, {});
  EXPECT_LE((all.correction(r) - delta).abs().max().item<double>(), 1e-9);
  EXPECT_LE(all.remaining(r).abs().max().item<double>(), 1e-9);
  // Hidden positions say nothing.
  Tensor hidden = torch::zeros({6, 12}, torch::kBool);
  hidden[2].slice(0, 3, 6).fill_(true);
  const StartCorrection some(G, hidden);
  EXPECT_LE((some.correction(r.masked_fill(hidden, 0)) - delta).abs().max().item<double>(), 1e-9);
  // What no start explains stays: it is perpendicular to G.
  r = torch::randn({6, 12}, torch::kFloat64);
  const Tensor left = all.remaining(r);
  EXPECT_LE(all.correction(left).abs().max().item<double>(), 1e-7);
  EXPECT_GT(left.norm().item<double>(), 0.5 * r.norm().item<double>());
}

Observation with_view(const kernels::LawDescription& law, const LaboratoryView& view,
                      const testing::ObservedScene& scene = {}) {
  return laboratory_view(testing::observe(law, scene), view);
}

TEST(KnownStarts, AHiddenPointIsTracedBackAndALateOneLeftOut) {
  LaboratoryView view;
  view.share = 0.2;
  Observation o = with_view(testing::elastic_body(), view);
  const std::vector<double> truth = o.tracers;
  const auto hide = [&](std::int64_t frame, std::int64_t point) {
    for (int k = 0; k < 3; ++k) {
      o.x[3 * (frame * o.points() + point) + k] = std::nan("");
      if (frame == 0) o.tracers[3 * point + k] = std::nan("");
    }
  };
  hide(0, 1);
  hide(1, 1);
  for (std::int64_t f = 0; f < 30; ++f) hide(f, 4);
  const Observation known = with_known_starts(o, "o");
  ASSERT_EQ(known.points(), o.points() - 1);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(known.tracers[3 + k], truth[3 + k], 1e-3);
    EXPECT_EQ(known.tracers[3 * 4 + k], truth[3 * 5 + k]);  // the next one moved up
    EXPECT_EQ(known.positions(30)[3 * 4 + k], o.positions(30)[3 * 5 + k]);
  }
  for (std::int64_t p = 0; p < o.points(); ++p) {
    for (std::int64_t f = 0; f < 30; ++f) hide(f, p);
  }
  EXPECT_THAT(testing::error_of([&] { with_known_starts(o, "seen.h5"); }), HasSubstr("seen.h5"));
}

FitOptions schedule() {
  FitOptions options;
  options.dtype = "float64";
  options.stages = {{0.3, 4, 3}, {1, 2, 8}};
  return options;
}

FitHooks quiet() {
  FitHooks hooks;
  hooks.progress = false;
  return hooks;
}

/// Root of the mean square of a coordinate between fitted points and the truth, over the noise.
double error_over_noise(const Inference& found, const Observation& truth, double noise) {
  double sum = 0;
  for (std::size_t k = 0; k < truth.x.size(); ++k)
    sum += std::pow(found.fitted.x[k] - truth.x[k], 2);
  return std::sqrt(sum / static_cast<double>(truth.x.size())) / noise;
}

struct Seen {
  const char* name;
  LaboratoryView view;
  double at_most;  ///< error of the fitted paths over the noise
};

class SeenWithNoise : public ::testing::TestWithParam<Seen> {};

TEST_P(SeenWithNoise, PathsAreFoundToAFractionOfTheNoise) {
  const auto variables =
      make_analytic_variables(kernels::LawId::elastic, {{1e4, 1e5}, {1e4, 1e5}}, 8, 1);
  LaboratoryView view = GetParam().view;
  const Observation noisy = with_view(testing::elastic_body(), view);
  view.noise = view.hidden = 0;
  const Observation truth = with_view(testing::elastic_body(), view);
  const Inference found = infer(noisy, "o", *variables, schedule(), quiet());
  EXPECT_TRUE(found.explained);
  // The residual is the noise; one parameter a start, of 41 or 9 positions, is fitted to it.
  const double noise = GetParam().view.noise * 0.25;
  EXPECT_NEAR(std::sqrt(found.fit_mse) / noise, 1, 0.1);
  EXPECT_LT(error_over_noise(found, truth, noise), GetParam().at_most);
  EXPECT_NEAR(found.fit.law.mu, 2e4, 0.05 * 2e4);
  const RigidMotion motion = testing::ObservedScene{}.motion;
  EXPECT_LT((found.fit.motion.linear - motion.linear).norm(), 0.02);
}

LaboratoryView view_of(double share, std::int64_t stride, double hidden) {
  LaboratoryView view;
  view.noise = 0.005;
  view.share = share;
  view.stride = stride;
  view.hidden = hidden;
  return view;
}

INSTANTIATE_TEST_SUITE_P(Views, SeenWithNoise,
                         ::testing::Values(Seen{"AllParticles", view_of(1, 1, 0), 0.25},
                                           Seen{"SomePoints", view_of(0.3, 5, 0), 0.5}),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace uniphy
