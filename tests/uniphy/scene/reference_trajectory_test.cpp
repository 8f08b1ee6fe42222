// Whole simulations against trajectories of an independent program written to the specification.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ops/kernels/laws/law_parameters.hpp"
#include "uniphy/geometry/shapes/box.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/scene/scene.hpp"

namespace uniphy {
namespace {

struct Reference {
  SceneDescription scene;
  std::vector<double> x;
};

Reference read_reference(const std::string& material) {
  const hdf5::Reader file(std::string(UNIPHY_SOURCE_DIR) + "/tests/data/reference_trajectories.h5");
  const auto number = [&](const char* name) { return file.attribute_real("/" + material, name); };
  Reference reference;
  reference.x = file.read<double>("/" + material + "/x", {-1, 216, 3}, hdf5::Values::finite);

  SceneDescription& scene = reference.scene;
  scene.grid.n = static_cast<int>(number("grid"));
  scene.dt = number("dt");
  scene.steps = static_cast<std::int64_t>(number("steps"));
  scene.frame_stride = static_cast<std::int64_t>(number("every"));
  BodyDescription body;
  const double side = number("size");
  body.solid = std::make_shared<Box>(Eigen::Vector3d(side, side, side));
  body.filling = {Filling::Kind::per_side, static_cast<std::int64_t>(number("res")), 0, 0};
  body.placement.centre = {number("cx"), number("cy"), number("cz")};
  body.density = number("rho");
  body.velocity = {number("vx"), number("vy"), number("vz")};
  body.angular_velocity = {number("wx"), number("wy"), number("wz")};
  body.law.id = kernels::law_id(material);
  for (const kernels::LawParameter& p : kernels::law_parameters(body.law.id))
    body.law.*p.member = number(p.name);
  scene.bodies.push_back(body);
  return reference;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

class ReferenceTrajectory : public testing::TestWithParam<const char*> {};

TEST_P(ReferenceTrajectory, AgreesInDoublePrecision) {
  const Reference reference = read_reference(GetParam());
  const Trajectory trajectory = run_scene(reference.scene);
  ASSERT_EQ(trajectory.x.size(), reference.x.size());
  const double difference = largest_difference(trajectory.x, reference.x);
  // Measured 6e-15 and less; the specification asks for 1e-9.
  EXPECT_LT(difference, 1e-12);
  // The body has moved, hit the floor and deformed: agreement of still pictures would prove little.
  const std::vector<double> first(reference.x.begin(), reference.x.begin() + 216 * 3);
  const std::vector<double> last(reference.x.end() - 216 * 3, reference.x.end());
  EXPECT_GT(largest_difference(first, last), 0.1);
}

TEST_P(ReferenceTrajectory, SinglePrecisionStaysClose) {
  Reference reference = read_reference(GetParam());
  reference.scene.single_precision = true;
  EXPECT_LT(largest_difference(run_scene(reference.scene).x, reference.x), 2e-3);
}

INSTANTIATE_TEST_SUITE_P(Materials, ReferenceTrajectory,
                         testing::Values("elastic", "newtonian", "plasticine", "sand",
                                         "non_newtonian"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace uniphy
