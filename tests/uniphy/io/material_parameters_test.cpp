#include "uniphy/io/material_parameters.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace uniphy {
namespace {

TEST(MaterialParameters, LeaveOutWhatTheLawHasNot) {
  kernels::LawDescription law;
  law.id = kernels::LawId::plasticine;
  law.mu = 1, law.lambda = 2, law.tau_y = 3, law.theta = 4, law.eta = 5;
  const MaterialParameters row = parameters_of(law);
  EXPECT_EQ(row[0], 1);
  EXPECT_EQ(row[1], 2);
  EXPECT_EQ(row[2], 3);
  EXPECT_TRUE(std::isnan(row[3]));
  EXPECT_TRUE(std::isnan(row[4]));
  for (const double none : no_parameters()) EXPECT_TRUE(std::isnan(none));
}

// The attributes of files that exist.
TEST(MaterialParameters, AreDescribedAsEver) {
  const hdf5::Info info = material_parameter_info();
  EXPECT_EQ(info.units, "Pa, Pa, Pa, rad, Pa s");
  EXPECT_EQ(info.description, "mu, lambda, tau_y, theta, eta; NaN where there is none");
}

}  // namespace
}  // namespace uniphy
