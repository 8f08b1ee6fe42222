#include "uniphy/bench/bench.hpp"

#include <cmath>
#include <cstdio>

#include "ops/kernels/base/error.hpp"
#include "uniphy/bench/goals.hpp"
#include "uniphy/bench/roofline.hpp"
#include "uniphy/bench/subjects.hpp"

namespace uniphy::bench {
namespace {

void run(const BenchOptions& options, RunDirectory& out, Metrics& metrics) {
  const int threads = out.threads();
  BenchReport report;
  bench_machine(options, threads, report);
  const struct {
    const char* name;
    void (*measure)(const BenchOptions&, int, BenchReport&);
  } subjects[] = {{"svd", bench_svd}, {"laws", bench_laws},   {"learned", bench_learned},
                  {"mpm", bench_mpm}, {"epoch", bench_epoch}, {"train", bench_train}};
  for (const auto& subject : subjects) {
    if (!options.measures(subject.name)) continue;
    std::fprintf(stderr, "bench: %s\n", subject.name);
    subject.measure(options, threads, report);
  }

  const std::vector<Goal> all = goals(report, options);
  for (const Goal& goal : all) metrics.set(goal.metric, goal.measured);
  const std::string text = rows_table(report) + "\n" + goals_table(all);
  std::fputs(text.c_str(), stdout);
  out.write_table("table.txt", "Measured", text);
  write_rows(report, out.file("rows.csv"));
  out.draw("roofline.png", roofline(report));
}

}  // namespace

ExperimentInfo bench_info() {
  return {"uniphy_bench",
          "Measures in one run the limits of this machine, every op, whole roll-outs and training, "
          "each on one thread and on all, beside the same work in plain LibTorch tensors at its "
          "best settings of threads. The shortest of several rounds counts; ratios are of times "
          "from the same rounds and equal numbers of threads.",
          {"CONFIG.yaml         what is measured, and how long"},
          {"DIR/table.txt       the printed tables: every measured row, then the goals",
           "DIR/rows.csv        the rows, in seconds",
           "DIR/roofline.png    rates of one core over arithmetic intensity"},
          {"uniphy_bench configs/bench/bench.yaml --out out/bench/bench",
           "uniphy_bench configs/bench/bench.yaml --set 'subjects=[mpm]' --set rounds=10"}};
}

RunFunction declare_bench(Section& config) {
  const BenchOptions options = read_bench_options(config);
  return [options](RunDirectory& out, Metrics& metrics) { run(options, out, metrics); };
}

}  // namespace uniphy::bench
