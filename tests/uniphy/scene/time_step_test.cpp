#include "uniphy/scene/time_step.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/scene/scene.hpp"

namespace uniphy {
namespace {

using kernels::LawDescription;
using kernels::LawId;

LawDescription law(LawId id, double mu, double lambda, double tau_y = 0, double theta = 0,
                   double eta = 0) {
  LawDescription description;
  description.id = id;
  description.mu = mu;
  description.lambda = lambda;
  description.tau_y = tau_y;
  description.theta = theta;
  description.eta = eta;
  return description;
}

TEST(Stiffness, FindsTheWaveModulusOfEveryLaw) {
  const double mu = 3e4, lambda = 5e4;
  // The steepest secant up to 1 % of compression lies a little above the modulus at rest.
  for (const LawId id : {LawId::elastic, LawId::plasticine, LawId::sand, LawId::non_newtonian,
                         LawId::fixed_corotated}) {
    const Stiffness found = estimate_stiffness(law(id, mu, lambda, 1e5, 0.3, 1));
    EXPECT_NEAR(found.wave_modulus, lambda + 2 * mu, 0.05 * (lambda + 2 * mu))
        << kernels::law_name(id);
    EXPECT_EQ(found.viscosity, 0) << kernels::law_name(id);
  }
  const Stiffness water = estimate_stiffness(law(LawId::water, 0, lambda));
  EXPECT_NEAR(water.wave_modulus, lambda, 0.05 * lambda);
  const Stiffness fluid = estimate_stiffness(law(LawId::newtonian, 70, lambda));
  const double bulk = 7 * (2.0 / 3 * 70 + lambda);
  EXPECT_GT(fluid.wave_modulus, bulk * 0.99);
  EXPECT_LT(fluid.wave_modulus, bulk * 1.07);
  EXPECT_NEAR(fluid.viscosity, 70, 1e-6 * 70);
}

TEST(StableTimeStep, TakesTheStricterLimit) {
  // c = 10 m/s, Δx = 0.05, at rest
  EXPECT_NEAR(stable_time_step({1e5, 0}, 1000, 0.05, 0, 1), 0.005, 1e-15);
  EXPECT_NEAR(stable_time_step({1e5, 0}, 1000, 0.05, 10, 0.5), 0.5 * 0.05 / 40, 1e-15);
  EXPECT_NEAR(stable_time_step({1e5, 1000}, 1000, 0.05, 0, 1), 0.0025 / 6, 1e-15);
}

TEST(RoundTimeStep, KeepsTwoDigitsDownwards) {
  EXPECT_EQ(round_time_step(0.00029722), 0.00029);
  EXPECT_EQ(round_time_step(0.00048000001), 0.00048);
  EXPECT_EQ(round_time_step(9.99e-5), 9.9e-5);
  EXPECT_EQ(round_time_step(1e-3), 1e-3);
  EXPECT_EQ(round_time_step(0.9), 0.9);
}

struct Extreme {
  const char* name;
  LawDescription law;
};

class AutomaticTimeStep : public testing::TestWithParam<Extreme> {};

TEST_P(AutomaticTimeStep, CarriesAFallIntoACornerThroughTheRangesOfTheSpecification) {
  SceneDescription scene;
  scene.duration = 0.3;
  scene.frame_stride = 10;
  BodyDescription body;
  body.solid = make_shape("box");
  body.filling = {Filling::Kind::per_side, 6, 0, 0};
  body.placement.size = 0.3;
  body.placement.centre = {0.4, 0.4, 0.4};
  body.velocity = {-2, -3, -1};
  body.angular_velocity = {4, -2, 3};
  body.law = GetParam().law;
  scene.bodies.push_back(body);

  const PlacedScene placed = place_scene(scene);
  EXPECT_LE(placed.grid.dt, placed.stable_dt);
  EXPECT_NEAR(static_cast<double>(placed.steps) * placed.grid.dt, 0.3, placed.grid.dt);
  // What blows up gains speed without limit; falling through the cube gives at most 6 m/s.
  double fastest = 0;
  FrameFields fields;
  fields.v = true;
  run_scene(scene, placed, fields, [&](double, std::int64_t, const ParticleState& state) {
    for (const double v : state.v) fastest = std::max(fastest, std::abs(v));
    return true;
  });
  EXPECT_LT(fastest, 15) << "dt " << placed.grid.dt;
}

INSTANTIATE_TEST_SUITE_P(
    Laws, AutomaticTimeStep,
    testing::Values(Extreme{"elastic_soft", law(LawId::elastic, 350, 500)},
                    Extreme{"elastic_stiff", law(LawId::elastic, 2595196, 2580120)},
                    Extreme{"newtonian_soft", law(LawId::newtonian, 50, 30)},
                    Extreme{"newtonian_stiff", law(LawId::newtonian, 1e3, 5e5)},
                    Extreme{"plasticine_soft", law(LawId::plasticine, 1e4, 1e4, 5e3)},
                    Extreme{"plasticine_stiff", law(LawId::plasticine, 1e6, 3e6, 1e4)},
                    Extreme{"sand_soft", law(LawId::sand, 2400, 2400, 0, 0.01)},
                    Extreme{"sand_stiff", law(LawId::sand, 9e6, 9e6, 0, 0.4)},
                    Extreme{"non_newtonian_soft", law(LawId::non_newtonian, 1e3, 1e3, 1e3, 0, 0.1)},
                    Extreme{"non_newtonian_stiff",
                            law(LawId::non_newtonian, 2e6, 2e6, 2e6, 0, 100)},
                    Extreme{"fixed_corotated", law(LawId::fixed_corotated, 1e6, 1e6)},
                    Extreme{"water", law(LawId::water, 0, 1e6)}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace uniphy
