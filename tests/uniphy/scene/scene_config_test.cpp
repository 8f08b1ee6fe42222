#include "uniphy/scene/scene_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/scene/simulation_run.hpp"

namespace uniphy {
namespace {

using testing::HasSubstr;

SceneDescription load(const std::string& yaml, const std::vector<std::string>& overrides = {}) {
  const Config config = Config::parse(yaml, "scene.yaml", overrides);
  Section root = config.root();
  const SceneSource source = read_scene(root);
  config.finish();
  return source.load();
}

const char* const kCube = R"(
scene: {grid: 24, dt: 1e-4, steps: 7, frame_stride: 2, gravity: [0, 0, -1], walls: noslip, bound: 2,
        dtype: float32}
bodies:
  - name: cube
    shape: {type: box, sides: [1, 2, 1]}
    center: [0.4, 0.5, 0.6]
    rotation: [0, 0, 90]
    size: 0.3
    filling: {type: per_side, count: 6}
    density: 900
    velocity: [1, 2, 3]
    angular_velocity: [4, 5, 6]
    law: {type: sand, mu: 1e5, lambda: 2e5, theta: 0.3}
)";

TEST(ReadScene, ReadsEveryKey) {
  const SceneDescription scene = load(kCube);
  EXPECT_EQ(scene.grid.n, 24);
  EXPECT_EQ(scene.dt, 1e-4);
  EXPECT_EQ(scene.steps, 7);
  EXPECT_EQ(scene.frame_stride, 2);
  EXPECT_EQ(scene.grid.gravity[2], -1);
  EXPECT_EQ(scene.grid.gravity[1], 0);
  EXPECT_EQ(scene.grid.wall, kernels::Wall::noslip);
  EXPECT_EQ(scene.grid.bound, 2);
  EXPECT_TRUE(scene.single_precision);
  ASSERT_EQ(scene.bodies.size(), 1u);
  const BodyDescription& body = scene.bodies[0];
  EXPECT_EQ(body.name, "cube");
  EXPECT_EQ(body.solid->volume(), 2);
  EXPECT_EQ(body.placement.centre, Eigen::Vector3d(0.4, 0.5, 0.6));
  EXPECT_EQ(body.placement.size, 0.3);
  EXPECT_NEAR(body.placement.rotation(1, 0), 1, 1e-15);
  EXPECT_EQ(body.density, 900);
  EXPECT_EQ(body.velocity, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(body.angular_velocity, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(body.law.id, kernels::LawId::volume_corrected_sand);  // the option's default
  EXPECT_EQ(body.law.theta, 0.3);
  EXPECT_EQ(place_body(body).x.size(), 3u * 6 * 3);
}

TEST(ReadScene, ResolvedConfigurationGivesTheSameScene) {
  const Config config = Config::parse(kCube, "scene.yaml", {"scene.steps=", "scene.duration=0.01"});
  Section root = config.root();
  const PlacedScene first = place_scene(read_scene(root).load());
  const PlacedScene again = place_scene(load(config.resolved()));
  EXPECT_EQ(first.x, again.x);
  EXPECT_EQ(first.v, again.v);
  EXPECT_EQ(first.steps, again.steps);
}

/// What reading the scene with these overrides throws.
std::string error_of(const std::vector<std::string>& overrides) {
  const Config config = Config::parse(kCube, "scene.yaml", overrides);
  Section root = config.root();
  try {
    read_scene(root).load();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(ReadScene, DurationAndStepsExcludeEachOther) {
  EXPECT_EQ(error_of({"scene.duration=0.5"}),
            "--set scene.duration=0.5: scene.duration: expected this or scene.steps, found both "
            "(scene.yaml:2: \"7\")");
  // One of them in the configuration that a run leaves, which can be run again.
  for (const auto& [overrides, steps] : std::vector<std::pair<std::vector<std::string>, bool>>{
           {{}, true},
           {{"scene.duration=none"}, true},
           {{"scene.steps=", "scene.duration=1"}, false}}) {
    const Config config = Config::parse(kCube, "scene.yaml", overrides);
    Section root = config.root();
    read_scene(root);
    config.finish();
    EXPECT_EQ(config.resolved().find("steps:") != std::string::npos, steps);
    const Config again = Config::parse(config.resolved());
    Section root_again = again.root();
    read_scene(root_again);
    again.finish();
    EXPECT_EQ(again.resolved(), config.resolved());
  }
}

TEST(ReadScene, InPlaceAndThePlacementExcludeEachOther) {
  const std::string file = testing::TempDir() + "uniphy_in_place.csv";
  std::ofstream(file) << "0.5 0.5 0.5\n0.6 0.5 0.5\n";
  const std::string text = "bodies:\n  - shape: {type: particles, file: " + file +
                           ", particle_volume: 1e-4, in_place: true}\n"
                           "    law: {type: water, lambda: 1e4}\n";
  const auto resolved = [&](const std::vector<std::string>& overrides) {
    const Config config = Config::parse(text, "scene.yaml", overrides);
    Section root = config.root();
    read_scene(root);
    config.finish();
    return config.resolved();
  };
  const std::string once = resolved({});
  EXPECT_EQ(once.find("size:"), once.npos);
  load(once);  // a run's configuration can be run again
  for (const char* key : {"center", "rotation", "size", "on_floor"}) {
    try {
      resolved({std::string("bodies.0.") + key +
                (key[0] == 'o'   ? "=true"
                 : key[0] == 's' ? "=0.3"
                                 : "=[1, 2, 3]")});
      FAIL() << key;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(key));
    }
  }
  std::filesystem::remove(file);
}

TEST(ReadScene, RefusesNumbersBeyondPhysics) {
  for (const char* override :
       {"bodies.0.density=1e300", "scene.dt=1e-300", "scene.gravity.1=1e300"}) {
    EXPECT_THAT(error_of({override}), HasSubstr(override));
  }
}

TEST(ReadScene, EveryShapeOfTheCatalogueHasItsDefaultsInTheConfiguration) {
  for (const std::string& name : shape_names()) {
    const SceneDescription scene =
        load("bodies: [{shape: {type: " + name + "}, law: {type: water, lambda: 1e4}}]");
    EXPECT_EQ(scene.bodies[0].solid->volume(), make_shape(name)->volume()) << name;
  }
}

TEST(ReadScene, EveryFillingGivesParticles) {
  for (const char* filling : {"{type: lattice, particles: 300}", "{type: per_side, count: 7}",
                              "{type: spacing, width: 0.04}", "{type: random, particles: 300}"}) {
    const SceneDescription scene =
        load(std::string("bodies: [{law: {type: water, lambda: 1e4}, filling: ") + filling + "}]");
    EXPECT_NEAR(place_body(scene.bodies[0]).x.size(), 300, 212) << filling;
  }
}

TEST(ReadScene, LawsAreOptionalWhereTheyWillBeReplaced) {
  const Config config = Config::parse("bodies: [{shape: {type: torus}}]");
  Section root = config.root();
  const SceneSource source = read_scene(root, false);
  config.finish();
  EXPECT_EQ(source.load().bodies.size(), 1u);
}

class ExampleScene : public testing::TestWithParam<const char*> {
 protected:
  // Examples name their files from the root of the repository.
  void SetUp() override { std::filesystem::current_path(UNIPHY_SOURCE_DIR); }
};

TEST_P(ExampleScene, CanStart) {
  const Config config = Config::load(std::string("configs/simulate/") + GetParam() + ".yaml",
                                     {"scene.steps=", "scene.duration=0"});
  Section root = config.root();
  const SceneSource source = read_scene(root);
  read_simulation_output(root);
  config.finish();
  const SceneDescription scene = source.load();
  const PlacedScene placed = place_scene(scene);
  EXPECT_LE(placed.grid.dt, placed.stable_dt / scene.safety);
  EXPECT_GT(placed.particles(), 500);
}

INSTANTIATE_TEST_SUITE_P(Configs, ExampleScene,
                         testing::Values("benchmark_cube", "falling_torus", "five_materials",
                                         "two_bodies", "mesh"),
                         [](const auto& info) { return std::string(info.param); });

struct BadScene {
  const char* name;
  const char* assignment;  ///< applied to kCube
  const char* message;
};

class RefusedScene : public testing::TestWithParam<BadScene> {};

TEST_P(RefusedScene, SaysWhatIsWrong) {
  try {
    place_scene(load(kCube, {GetParam().assignment}));
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr(GetParam().message));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, RefusedScene,
    testing::Values(
        BadScene{"grid_too_small", "scene.grid=4", "scene.grid"},
        BadScene{"walls_fill_the_grid", "scene.bound=12", "less than half the grid of 24"},
        BadScene{"dt_negative", "scene.dt=-1", "scene.dt"},
        BadScene{"dt_word", "scene.dt=fast", "scene.dt"},
        BadScene{"safety_zero", "scene.safety=0", "scene.safety"},
        BadScene{"unknown_wall", "scene.walls=sticky", "scene.walls"},
        BadScene{"unknown_dtype", "scene.dtype=float16", "scene.dtype"},
        BadScene{"gravity_short", "scene.gravity=[0, 1]", "scene.gravity"},
        BadScene{"unknown_key", "scene.gird=20", "grid"},
        BadScene{"no_bodies", "bodies=[]", "bodies"},
        BadScene{"unknown_shape", "bodies.0.shape.type=teapot", "bodies.0.shape.type"},
        BadScene{"key_of_another_shape", "bodies.0.shape.radius=0.2", "bodies.0.shape.radius"},
        BadScene{"shape_parameter", "bodies.0.shape={type: torus, minor: 0.5}",
                 "body \"cube\": torus.minor"},
        BadScene{"size_zero", "bodies.0.size=0", "bodies.0.size"},
        BadScene{"density_negative", "bodies.0.density=-1", "bodies.0.density"},
        BadScene{"outside", "bodies.0.center=[0.1, 0.5, 0.5]", "body \"cube\": spans x"},
        BadScene{"unknown_law", "bodies.0.law.type=jelly", "bodies.0.law.type"},
        BadScene{"missing_parameter", "bodies.0.law={type: sand, mu: 1e5, lambda: 1e5}",
                 "bodies.0.law.theta"},
        BadScene{"parameter_not_positive", "bodies.0.law.mu=0", "bodies.0.law.mu"},
        BadScene{"parameter_nan", "bodies.0.law.mu=.nan", "bodies.0.law.mu"},
        BadScene{"angle_in_degrees", "bodies.0.law.theta=30", "bodies.0.law.theta"},
        BadScene{"parameter_of_another_law", "bodies.0.law.eta=1", "bodies.0.law.eta"},
        BadScene{"no_law", "bodies=[{shape: {type: box}}]", "bodies.0.law.type"},
        BadScene{"same_name_twice",
                 "bodies=[{name: a, law: {type: water, lambda: 1}}, "
                 "{name: a, law: {type: water, lambda: 1}}]",
                 "found \"a\" again"},
        BadScene{"mesh_missing", "bodies.0.shape={type: mesh, file: no/mesh.obj}",
                 "bodies.0.shape.file"},
        BadScene{"learned_without_model", "bodies.0.law={type: learned}", "bodies.0.law.model"},
        BadScene{"model_missing", "bodies.0.law={type: learned, model: no/model.h5}",
                 "no/model.h5"},
        BadScene{"latent_missing",
                 "bodies.0.law={type: learned, latent: {type: fitted, path: no/where}}",
                 "no/where"},
        BadScene{"filling_zero", "bodies.0.filling={type: random, particles: 0}",
                 "bodies.0.filling.particles"}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace uniphy
