#include "uniphy/inference/material_reading.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace uniphy {
namespace {

using kernels::LawDescription;
using kernels::LawId;

LawDescription law_of(LawId id, double mu, double lambda) {
  LawDescription law;
  law.id = id;
  law.mu = mu;
  law.lambda = lambda;
  return law;
}

constexpr double kStep = 5e-4;

TEST(MaterialReading, ModuliOfAnElasticBody) {
  const MaterialReading m = read_material(law_of(LawId::elastic, 2e4, 5e4), kStep, 0.3);
  EXPECT_EQ(m.material, "elastic");
  EXPECT_NEAR(m.mu, 2e4, 1e-4 * 2e4);
  EXPECT_NEAR(m.lambda, 5e4, 1e-4 * 5e4);
  EXPECT_NEAR(m.poisson, 5.0 / 14, 0.005);
  EXPECT_NEAR(m.young, 2 * m.mu * (1 + m.poisson), 1e-6 * m.young);
  EXPECT_TRUE(std::isnan(m.yield_stress));
  EXPECT_TRUE(std::isnan(m.viscosity));
}

TEST(MaterialReading, YieldStressOfPlasticine) {
  LawDescription law = law_of(LawId::plasticine, 1e5, 1.5e5);
  law.tau_y = 4e3;
  MaterialReading m = read_material(law, kStep, 0.3);
  EXPECT_EQ(m.material, "plasticine");
  EXPECT_NEAR(m.mu, 1e5, 500);
  EXPECT_NEAR(m.lambda, 1.5e5, 1500);
  EXPECT_NEAR(m.yield_stress, 4e3, 40);
  // One that was not seen to yield is elastic as far as anybody knows: it does at 0.02.
  m = read_material(law, kStep, 0.015);
  EXPECT_EQ(m.material, "elastic");
  EXPECT_TRUE(std::isnan(m.yield_stress));
}

TEST(MaterialReading, FrictionAngleOfSand) {
  for (const double angle : {0.05, 0.35}) {
    LawDescription law = law_of(LawId::sand, 3e5, 2e5);
    law.theta = angle;
    const MaterialReading m = read_material(law, kStep, 0.3);
    EXPECT_EQ(m.material, "sand");
    EXPECT_NEAR(m.mu, 3e5, 3e3);
    EXPECT_NEAR(m.friction_angle, angle, 0.01 * angle);
    EXPECT_NEAR(m.cohesion, 0, 1);
  }
}

TEST(MaterialReading, SandWithoutFrictionIsAFluid) {
  LawDescription law = law_of(LawId::sand, 3e5, 2e5);
  law.theta = 0.01;  // the least of the family
  EXPECT_EQ(read_material(law, kStep, 0.3).material, "sand");
  law.theta = 1e-3;
  const MaterialReading m = read_material(law, kStep, 0.3);
  EXPECT_EQ(m.material, "newtonian");
  EXPECT_NEAR(m.lambda, 4e5, 4e3);  // the bulk modulus
  EXPECT_NEAR(m.viscosity, 0, 1e-6);
  EXPECT_TRUE(std::isnan(m.friction_angle));
  EXPECT_TRUE(std::isnan(m.mu));
}

TEST(MaterialReading, CohesionOfSandThatBearsTension) {
  LawDescription law = law_of(LawId::cohesive_sand, 3e5, 2e5);
  law.theta = 0.4;
  law.cohesion = 1e-3;
  const MaterialReading m = read_material(law, kStep, 0.3);
  EXPECT_EQ(m.material, "sand");
  EXPECT_NEAR(m.friction_angle, 0.4, 0.01 * 0.4);
  // The apex at tr ε = c is a tension of (λ + 2μ/3) c, which a cone bears at c cot θ.
  EXPECT_NEAR(m.cohesion, 4e5 * 1e-3 * std::tan(0.4), 0.02 * 400 * std::tan(0.4));
}

TEST(MaterialReading, ViscosityOfAFluidAndOfAFlow) {
  MaterialReading m = read_material(law_of(LawId::newtonian, 200, 1e5), kStep, 0.3);
  EXPECT_EQ(m.material, "newtonian");
  EXPECT_NEAR(m.viscosity, 100, 1);  // τ = ½ μ (C + Cᵀ)
  EXPECT_TRUE(std::isnan(m.mu));
  LawDescription law = law_of(LawId::non_newtonian, 1e5, 1e5);
  law.tau_y = 5e3;
  law.eta = 10;
  m = read_material(law, kStep, 0.3);
  EXPECT_EQ(m.material, "non_newtonian");
  EXPECT_NEAR(m.viscosity, 10, 0.2);
  EXPECT_NEAR(m.yield_stress, 5e3, 50);
}

TEST(MaterialReading, TheStrainSeenIsThatOfAllButAFew) {
  std::vector<double> F;
  for (int k = 0; k < 2000; ++k) {
    const double q = k == 7 ? 1 : 0.1;  // one outlier
    const double a = std::exp(q / std::sqrt(2.0));
    for (const double x : {0.0, a, 0.0, -1 / a, 0.0, 0.0, 0.0, 0.0, 1.0}) F.push_back(x);
  }
  EXPECT_NEAR(strain_seen(F), 0.1, 1e-12);
  EXPECT_EQ(strain_seen({}), 0);
}

TEST(MaterialReading, WhatHardlyFlowsWhileItIsSeenIsElastic) {
  kernels::LawDescription law = law_of(LawId::non_newtonian, 1e5, 1e5);
  law.tau_y = 5e3;
  law.eta = 6e5;  // the excess falls by 1/e in η/(2 μ) = 3 s
  EXPECT_EQ(read_material(law, kStep, 0.3).material, "non_newtonian");
  EXPECT_EQ(read_material(law, kStep, 0.3, 1.0).material, "non_newtonian");
  const MaterialReading m = read_material(law, kStep, 0.3, 0.2);
  EXPECT_EQ(m.material, "elastic");
  EXPECT_TRUE(std::isnan(m.yield_stress));
  EXPECT_NEAR(m.mu, 1e5, 1e2);
  law.eta = 50;
  EXPECT_EQ(read_material(law, kStep, 0.3, 0.2).material, "non_newtonian");
}

}  // namespace
}  // namespace uniphy
