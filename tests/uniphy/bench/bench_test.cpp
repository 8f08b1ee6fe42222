// The bench on tiny sizes: that it measures everything and says so, not how fast anything is.

#include "uniphy/bench/bench.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/bench/goals.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy::bench {
namespace {

using ::testing::HasSubstr;

constexpr const char* kTiny =
    "rounds: 1\n"
    "seconds: 1e-6\n"
    "machine: {copy_mb: 1}\n"
    "svd: {matrices: 10000}\n"
    "laws: {names: [sand], particles: 100}\n"
    "learned: {particles: [70]}\n"
    "mpm: {particles: [27, 1000], goal_particles: 1000, steps: 2}\n"
    "epoch: {per_side: 4, steps: 10, rounds: 1, plain_steps: 1}\n"
    "train: {trajectories: 5, batch_per_trajectory: 8}\n";

struct Result {
  int code;
  std::string out, err;
};
Result run(const testing::Scratch& scratch, const std::vector<std::string>& overrides) {
  const std::string config = scratch.write("bench.yaml", kTiny).string();
  const std::string directory = scratch.file("out").string();
  std::vector<const char*> argv{"uniphy_bench",    config.c_str(), "--out",
                                directory.c_str(), "--threads",    "2"};
  for (const std::string& o : overrides) argv.insert(argv.end(), {"--set", o.c_str()});
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  Result result;
  result.code =
      run_experiment(static_cast<int>(argv.size()), argv.data(), bench_info(), declare_bench);
  result.out = ::testing::internal::GetCapturedStdout();
  result.err = ::testing::internal::GetCapturedStderr();
  return result;
}

TEST(Bench, MeasuresEveryNumberOfTheTable) {
  const testing::Scratch scratch;
  const Result result = run(scratch, {});
  ASSERT_EQ(result.code, 0) << result.err;
  const Metrics metrics = Metrics::read(scratch.file("out/metrics.json"));
  for (const char* name :
       {"fma_gflops_core", "svd3_f32_ns", "svd3_f32_speedup", "mpm_step_f32_fwd_ns",
        "mpm_step_f32_bwd_ns", "mpm_step_speedup", "law_published_fwd_peak_share",
        "law_published_bwd_over_fwd", "law_published_speedup", "law_isotropic_over_published",
        "epoch_published_s", "epoch_isotropic_s", "second_core_min", "per_particle_spread",
        "train_speedup"}) {
    ASSERT_TRUE(metrics.find(name)) << name;
    EXPECT_GT(*metrics.find(name), 0) << name;
  }
  for (const char* name : {"epoch_published_mb", "epoch_isotropic_mb"}) {
    ASSERT_TRUE(metrics.find(name)) << name;
    EXPECT_GE(*metrics.find(name), 0) << name;  // so little that the heap may have it already
  }
  for (const char* part : {"svd3 f32", "law sand", "learned published", "mpm step",
                           "epoch isotropic", "train isotropic", "goal", "second core"}) {
    EXPECT_THAT(result.out, HasSubstr(part));
  }
  const std::string table = read_text_file(scratch.file("out/table.txt"));
  EXPECT_EQ(result.out.substr(0, table.size()), table);
  EXPECT_THAT(result.out.substr(table.size()), HasSubstr("table.txt"));  // what the run wrote
  EXPECT_THAT(read_text_file(scratch.file("out/rows.csv")),
              HasSubstr("learned published,backward,70,"));
  EXPECT_EQ(std::filesystem::exists(scratch.file("out/roofline.png")), gnuplot_available());
}

TEST(Bench, LeavesOutWhatIsNotAskedFor) {
  const testing::Scratch scratch;
  ASSERT_EQ(run(scratch, {"subjects=[svd]", "svd.matrices=10"}).code, 0);
  const Metrics metrics = Metrics::read(scratch.file("out/metrics.json"));
  EXPECT_TRUE(metrics.find("svd3_f32_ns"));
  EXPECT_FALSE(metrics.find("mpm_step_f32_fwd_ns"));
  EXPECT_FALSE(metrics.find("second_core_min"));
}

TEST(Bench, RefusesBadKeys) {
  const testing::Scratch scratch;
  const struct {
    const char* set;
    const char* message;
  } cases[] = {{"round=3", "round: unknown key"},
               {"mpm.sizes=[8]", "mpm.sizes: unknown key"},
               {"subjects=[svd, speed]", "found \"speed\""},
               {"rounds=0", "rounds: expected an integer in [1, 1000]"},
               {"learned.particles=[0]", "learned.particles"},
               {"learned.particles=[8, 8]", "learned.particles: expected different sizes"},
               {"epoch.steps=9", "epoch.steps: expected a multiple of 5, found 9"},
               {"mpm.goal_particles=8", "mpm.goal_particles: expected one of mpm.particles, "}};
  for (const auto& c : cases) {
    const Result result = run(scratch, {c.set});
    EXPECT_EQ(result.code, 1) << c.set;
    EXPECT_THAT(result.err, HasSubstr(c.message));
  }
}

TEST(Bench, GoalsComeFromTheRightRows) {
  BenchOptions options;
  options.subjects = {"svd", "mpm"};
  options.svd_matrices = 100000;
  options.mpm_goal_particles = 100000;
  options.mpm_particles = {1000, 100000};
  BenchReport report;
  report.machine.fma_core = 100;
  report.machine.threads = 2;
  const auto add = [&](const char* work, const char* pass, std::int64_t n, double one, double all,
                       double plain, int plain_threads) {
    BenchRow row;
    row.work = work;
    row.pass = pass;
    row.particles = n;
    row.one = one;
    row.all = all;
    row.plain = plain;
    row.plain_setting = {plain_threads, 1};
    report.rows.push_back(row);
  };
  add("svd3 f32", "forward", 100000, 50e-9, 25e-9, 1e-6, 2);
  add("mpm step", "forward", 1000, 120e-9, 100e-9, kNone, 1);
  add("mpm step", "forward", 100000, 100e-9, 60e-9, 3e-6, 1);
  add("mpm step", "backward", 1000, 200e-9, 100e-9, kNone, 1);
  add("mpm step", "backward", 100000, 300e-9, 150e-9, 6e-6, 1);
  std::map<std::string, Goal> found;
  for (const Goal& goal : goals(report, options)) found[goal.metric] = goal;
  EXPECT_NEAR(found["svd3_f32_ns"].measured, 50, 1e-9);
  // The plain version is fastest on two threads, so ours counts on two.
  EXPECT_NEAR(found["svd3_f32_speedup"].measured, 40, 1e-9);
  EXPECT_NEAR(found["mpm_step_f32_fwd_ns"].measured, 100, 1e-9);
  EXPECT_TRUE(found["mpm_step_f32_fwd_ns"].passes());
  EXPECT_FALSE(found["mpm_step_f32_bwd_ns"].passes());
  EXPECT_NEAR(found["mpm_step_speedup"].measured, 9.0 / 0.4, 1e-9);
  EXPECT_NEAR(found["second_core_min"].measured, 100.0 / 60, 1e-9);
  EXPECT_NEAR(found["per_particle_spread"].measured, 1.5, 1e-9);
  EXPECT_EQ(found.count("train_speedup"), 0U);
  report.machine.threads = 1;  // there is no second core then
  for (const Goal& goal : goals(report, options)) EXPECT_NE(goal.metric, "second_core_min");
}

}  // namespace
}  // namespace uniphy::bench
