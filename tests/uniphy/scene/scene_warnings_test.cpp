#include "uniphy/scene/scene_warnings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "uniphy/geometry/shape_catalogue.hpp"

namespace uniphy {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

BodyDescription box(const char* name, double x, double size, std::int64_t per_side) {
  BodyDescription body;
  body.name = name;
  body.solid = make_shape("box");
  body.filling = {Filling::Kind::per_side, per_side, 0, 0};
  body.placement.centre = {x, 0.5, 0.5};
  body.placement.size = size;
  body.law.id = kernels::LawId::elastic;
  body.law.mu = 2e4;
  body.law.lambda = 4e4;
  return body;
}

SceneDescription scene_of(std::vector<BodyDescription> bodies, int grid) {
  SceneDescription scene;
  scene.grid.n = grid;
  scene.dt = 1e-4;
  scene.bodies = std::move(bodies);
  return scene;
}

std::vector<std::string> warnings_of(const SceneDescription& scene) {
  return scene_warnings(scene, place_scene(scene));
}

TEST(SceneWarnings, CountsParticlesOfACellAndSaysHowManyToAskFor) {
  // 5³ particles in 0.3³ m³: 19.2³ cells at grid 64.
  const SceneDescription sparse = scene_of({box("b", 0.5, 0.3, 5)}, 64);
  EXPECT_NEAR(particles_per_cell(place_scene(sparse)).at(0), 125 / (19.2 * 19.2 * 19.2), 1e-12);
  EXPECT_THAT(warnings_of(sparse), ElementsAre(AllOf(HasSubstr("body \"b\": 125 particles"),
                                                     HasSubstr("at least 7078, better 56624"))));
  // One a cell, as in the benchmark scenes of the field, is enough; a little less is not.
  EXPECT_THAT(warnings_of(scene_of({box("b", 0.5, 0.5, 10)}, 20)), IsEmpty());
  EXPECT_THAT(warnings_of(scene_of({box("b", 0.5, 0.5, 9)}, 20)), testing::SizeIs(1));
}

TEST(SceneWarnings, BodiesThatShareNodesWithoutTouching) {
  const double cell = 1.0 / 32;
  const auto pair = [&](double gap) {
    const double away = 0.125 + 0.5 * gap * cell;
    return scene_of({box("l", 0.5 - away, 0.25, 12), box("r", 0.5 + away, 0.25, 12)}, 32);
  };
  for (const double gap : {0.25, 1.0, 2.4}) {
    SCOPED_TRACE(gap);
    EXPECT_NEAR(body_gaps(place_scene(pair(gap)), 3)[1], gap, 1e-9);
    EXPECT_THAT(warnings_of(pair(gap)),
                ElementsAre(AllOf(HasSubstr("\"l\" and \"r\""), HasSubstr("share nodes"))));
  }
  EXPECT_THAT(warnings_of(pair(0)), IsEmpty());  // they touch on purpose
  EXPECT_THAT(warnings_of(pair(2.6)), IsEmpty());
  EXPECT_TRUE(std::isinf(body_gaps(place_scene(pair(3.5)), 3)[1]));
}

TEST(SceneWarnings, ATimeStepBeyondTheStableOne) {
  SceneDescription scene = scene_of({box("b", 0.5, 0.5, 10)}, 20);
  scene.dt = 1e-2;
  EXPECT_THAT(warnings_of(scene), ElementsAre(HasSubstr("beyond the stable")));
}

TEST(SceneWarnings, ALawFittedAtAnotherTimeStepOrToNothing) {
  SceneDescription scene = scene_of({box("b", 0.5, 0.5, 10)}, 20);  // at 1e-4 s
  LawOrigin& origin = scene.bodies[0].law_origin;
  origin = {LawOrigin::Kind::fitted, {1e-4, 1e-4}};
  EXPECT_THAT(warnings_of(scene), IsEmpty());
  origin.dt = {5e-4, 5e-4};
  EXPECT_THAT(
      warnings_of(scene),
      ElementsAre(AllOf(HasSubstr("body \"b\": its law was fitted at a time step of 0.0005"),
                        HasSubstr("dt is 0.0001"))));
  origin = {LawOrigin::Kind::fitted, {1e-4, 1e-4}, false};
  EXPECT_THAT(warnings_of(scene), ElementsAre(HasSubstr("did not show the material")));
}

}  // namespace
}  // namespace uniphy
