// kind: outside of uniphy_evaluate, from the configuration to the files, at a tiny size.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/uniphy/evaluation/small_run.hpp"
#include "uniphy/evaluation/evaluate_stage.hpp"
#include "uniphy/evaluation/outside_report.hpp"
#include "uniphy/evaluation/outside_scenes.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

std::string config(const testing::Scratch& scratch, const std::string& rows) {
  write_model(scratch.file("model.h5"), testing::readable_model(4));
  return "kind: outside\nmodel: " + scratch.file("model.h5").string() +
         "\nscene: {steps: 60, objects: 1, particles: 40, per_side: 4}\nanalytic: {starts: 2}\n"
         "fit: {schedule: {horizon: [1], candidates: [1], epochs: [2]}}\n" +
         rows;
}

constexpr const char* kJelly =
    "laws:\n  - {name: jelly, law: {type: fixed_corotated, mu: 4e4, lambda: 3e4}}\n";
constexpr const char* kElastic = "  - {name: soft, law: {type: elastic, mu: 4e4, lambda: 3e4}}\n";

std::vector<std::filesystem::path> fits(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "fits"))
    files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

TEST(Outside, MakesTheTableAndGoesOn) {
  const testing::Scratch scratch;
  const std::string yaml = config(scratch, kJelly);
  const auto out = scratch.file("out");
  const Metrics first = testing::run_stage(evaluate_stage, yaml, out);
  // The learned law and five families, in the cube and an object.
  EXPECT_EQ(first.find("fits"), 12);
  EXPECT_EQ(first.find("motions_failed"), 0);
  for (const char* name : {"forecast.jelly", "fit.jelly", "best_analytic.jelly",
                           "forecast.jelly.cube", "best_analytic.jelly.object_1"}) {
    ASSERT_TRUE(first.find(name)) << name;
    EXPECT_GT(*first.find(name), 0) << name;
  }
  EXPECT_EQ(first.find("rung.jelly"), 0);
  EXPECT_TRUE(first.find("explained.jelly.cube"));
  EXPECT_NEAR(*first.find("forecast.jelly"),
              0.5 * (*first.find("forecast.jelly.cube") + *first.find("forecast.jelly.object_1")),
              1e-15);
  EXPECT_THAT(read_text_file(out / "outside.md"), HasSubstr("| jelly | "));
  const std::string csv = read_text_file(out / "outside.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 13);
  ASSERT_EQ(fits(out).size(), 12u);  // and no state of an unfinished one

  // A second run reads the fits, one that was lost is made again to the same bits on one thread.
  std::filesystem::remove(fits(out)[3]);
  const Metrics again = testing::run_stage(evaluate_stage, yaml, out, 1);
  EXPECT_EQ(again.json(), first.json());
  // A mark shows that the others are not made again, and another law leaves them as they are.
  const auto files = fits(out);
  const auto cube = std::find_if(files.begin(), files.end(), [](const auto& file) {
    return file.filename().string().rfind("jelly.cube.learned", 0) == 0;
  });
  ASSERT_NE(cube, files.end());
  Metrics marked = Metrics::read(*cube);
  marked.set("forecast", 0.75);
  marked.write(*cube);
  const Metrics more =
      testing::run_stage(evaluate_stage, config(scratch, std::string(kJelly) + kElastic), out);
  EXPECT_EQ(more.find("forecast.jelly.cube"), 0.75);
  EXPECT_EQ(more.find("fits"), 12 + 10);  // elastic is no wrong law of an elastic body
  // Other settings of the fit do not.
  std::string other = yaml;
  other.replace(other.find("epochs: [2]"), 11, "epochs: [3]");
  EXPECT_NE(testing::run_stage(evaluate_stage, other, out).find("forecast.jelly.cube"), 0.75);
}

TEST(Outside, ATruthInsideOfAFamilyIsForecastByItAlone) {
  const testing::Scratch scratch;
  OutsideOptions o;
  o.steps = 300;
  o.objects = 0;
  o.per_side = 5;
  const std::vector<OutsideScene> scenes = outside_scenes(o);
  ASSERT_EQ(scenes.size(), 1u);
  kernels::LawDescription law;
  law.mu = 4e4;
  law.lambda = 3e4;
  const Observation seen = observe(scenes[0], law);
  EXPECT_EQ(seen.frames, 61);
  const auto variables = make_analytic_variables(law.id, {{3e4, 6e4}, {2e4, 5e4}}, 4, 1);
  FitOptions options;
  options.dtype = "float64";
  options.stages = {{1, 2, 30}};
  FitHooks quiet;
  quiet.progress = false;
  const Forecast right = forecast({seen, "seen"}, *variables, options, {}, quiet);
  EXPECT_LT(right.fit, 1e-4);
  EXPECT_LT(right.forecast, 3e-4);
  EXPECT_TRUE(right.explained);
  EXPECT_GT(right.roll_outs, 2);
  // Far too stiff, and no way to become softer.
  const auto wrong = make_analytic_variables(law.id, {{4e5, 4.1e5}, {3e5, 3e5}}, 1, 1);
  options.stages = {{1, 1, 1}};
  const Forecast stiff = forecast({seen, "seen"}, *wrong, options, {}, quiet);
  EXPECT_GT(stiff.forecast, 10 * right.forecast);
  EXPECT_FALSE(stiff.explained);
}

TEST(Outside, ObservationsAreRowsOfTheirOwn) {
  const testing::Scratch scratch;
  OutsideOptions o;
  o.steps = 60;
  o.objects = 0;
  o.per_side = 4;
  kernels::LawDescription law;
  law.mu = 4e4;
  law.lambda = 3e4;
  write_observation(scratch.file("seen.h5"), observe(outside_scenes(o)[0], law));
  const std::string row = "observations:\n  - {name: filmed, truth: elastic, file: " +
                          scratch.file("seen.h5").string() + "}\n";
  const Metrics metrics =
      testing::run_stage(evaluate_stage, config(scratch, row), scratch.file("out"));
  EXPECT_EQ(metrics.find("fits"), 5);
  EXPECT_EQ(metrics.find("forecast.filmed"), metrics.find("forecast.filmed.observed"));
  EXPECT_FALSE(metrics.find("forecast.jelly"));
  scratch.write("seen.h5", "nothing");
  EXPECT_THAT(testing::error_of([&] {
                testing::run_stage(evaluate_stage, config(scratch, row), scratch.file("other"));
              }),
              HasSubstr("seen.h5"));
}

TEST(Outside, DrawnObjectsFollowFromTheSeed) {
  OutsideOptions o;
  o.steps = 20;
  o.objects = 3;
  const auto place = [](const OutsideScene& s) {
    SceneDescription scene = s.scene;
    scene.bodies.front().law.mu = scene.bodies.front().law.lambda = 1e4;
    return place_scene(scene).x;
  };
  const auto a = outside_scenes(o), b = outside_scenes(o);
  ASSERT_EQ(a.size(), 4u);
  EXPECT_EQ(a[3].name, "object_3");
  EXPECT_EQ(place(a[2]), place(b[2]));
  EXPECT_NE(place(a[1]), place(a[2]));
  EXPECT_EQ(a[2].scene.dt, 5e-4);
  o.seed = 2;
  EXPECT_NE(place(outside_scenes(o)[2]), place(a[2]));
  EXPECT_EQ(place(outside_scenes(o)[0]), place(a[0]));
}

OutsideCell cell(const char* scene, const char* fitted, double forecast, const char* named = "") {
  OutsideCell c;
  c.law = "water";
  c.scene = scene;
  c.fitted = fitted;
  c.result.fit = 0.5 * forecast;
  c.result.forecast = forecast;
  c.named = named;
  return c;
}

TEST(Outside, RowsAreMediansAndTheBestOfTheWrongLaws) {
  const std::vector<OutsideCell> cells{cell("a", "learned", 0.01, "sand"),
                                       cell("a", "elastic", 0.4),
                                       cell("a", "newtonian", 0.2),
                                       cell("b", "learned", 0.03, "newtonian"),
                                       cell("b", "elastic", INFINITY),
                                       cell("b", "newtonian", 0.3),
                                       cell("c", "learned", 0.02, "newtonian"),
                                       cell("c", "elastic", 0.1),
                                       cell("c", "newtonian", 0.5)};
  const OutsideRow row = outside_rows(cells).at(0);
  EXPECT_EQ(row.forecast, 0.02);
  EXPECT_EQ(row.worst, 0.03);
  EXPECT_EQ(row.best_analytic, 0.2);
  EXPECT_EQ(row.analytic, "newtonian");
  EXPECT_EQ(row.named, "newtonian");
  const std::string table = outside_table(cells);
  EXPECT_THAT(table, HasSubstr("| water | 1 % | 2 % | 3 % | latent | yes | newtonian | 20 % "
                               "(newtonian) | 10 |"));
  EXPECT_THAT(table, HasSubstr("| water | 1 % | 3 % | 2 % |\n"));
  Metrics metrics;
  add_outside_metrics(cells, metrics);
  EXPECT_EQ(metrics.find("best_analytic.water.c"), 0.1);
  EXPECT_EQ(metrics.find("fit.water.b"), 0.015);

  // What failed is worse than everything.
  const std::vector<OutsideCell> failed{cell("a", "learned", INFINITY)};
  EXPECT_THAT(outside_table(failed), HasSubstr("| water | failed | failed | failed | latent |"));
}

}  // namespace
}  // namespace uniphy
