#include "uniphy/bench/goals.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace uniphy::bench {
namespace {

constexpr std::int64_t kManyParticles = 10000;  ///< from here on a second core must help
constexpr const char* kPasses[] = {"forward", "backward"};

struct Extremes {
  double low = kNone, high = kNone;
  void add(double value) {
    if (!(value >= low)) low = value;
    if (!(value <= high)) high = value;
  }
};

void add_learned(const BenchReport& report, std::vector<Goal>& goals) {
  Extremes share, back, speedup, over_published;
  for (const BenchRow* forward : report.all("learned published", "forward")) {
    const BenchRow* backward = report.find("learned published", "backward", forward->particles);
    share.add(forward->flops / forward->one / 1e9 / report.machine.fma_core);
    back.add(backward->one / forward->one);
    speedup.add(report.find("learned published", "both", forward->particles)->speedup());
    for (const BenchRow* published : {forward, backward}) {
      const BenchRow* isotropic =
          report.find("learned isotropic", published->pass, published->particles);
      over_published.add(published->one / isotropic->one);
    }
  }
  goals.push_back({"law_published_fwd_peak_share",
                   "learned law, published 4x128: share of FMA rate", share.low, 0.6, false});
  goals.push_back({"law_published_bwd_over_fwd", "  backward over forward", back.high, 2.5, true});
  goals.push_back(
      {"law_published_speedup", "  over plain tensors, both passes", speedup.low, 5, false});
  goals.push_back({"law_isotropic_over_published",
                   "learned law, isotropic 3x32: speed over published size", over_published.low, 10,
                   false});
}

void add_epochs(const BenchReport& report, std::vector<Goal>& goals) {
  const auto add = [&](const char* form, double seconds, double mb) {
    const BenchRow* row = report.all(std::string("epoch ") + form, "both").front();
    goals.push_back({fmt::format("epoch_{}_s", form),
                     fmt::format("epoch of Algorithm 2, {}: s on all threads", form), row->all,
                     seconds, true});
    goals.push_back(
        {fmt::format("epoch_{}_mb", form), "  peak extra memory, MB", row->memory_mb, mb, true});
    const std::string epoch = std::string("epoch ") + form;
    const BenchRow& z = *report.all(epoch + " by z", "both").front();
    const BenchRow& weights = *report.all(epoch + " by weights", "both").front();
    goals.push_back({fmt::format("epoch_{}_weights_ratio", form),
                     "  with gradients by the weights, over one without",
                     std::max(weights.one / z.one, weights.all / z.all), 1.35, true});
    goals.push_back({fmt::format("epoch_{}_weights_mb", form),
                     "  memory that these add to its peak, MB", weights.memory_mb, 60, true});
  };
  add("published", 6, 300);
  add("isotropic", 1, 200);
}

/// Largest cost of a particle-step over the smallest one, on one thread.
double spread(const BenchReport& report) {
  Extremes ratio;
  for (const char* pass : kPasses) {
    Extremes cost;
    for (const BenchRow* row : report.all("mpm step", pass)) cost.add(row->one);
    ratio.add(cost.high / cost.low);
  }
  return ratio.high;
}

}  // namespace

std::vector<Goal> goals(const BenchReport& report, const BenchOptions& options) {
  std::vector<Goal> g;
  g.push_back({"fma_gflops_core", "multiply-adds of one core, Gflop/s", report.machine.fma_core,
               kNone, false});
  if (options.measures("svd")) {
    const BenchRow& svd = *report.find("svd3 f32", "forward", options.svd_matrices);
    g.push_back({"svd3_f32_ns", "3x3 SVD, ns a matrix", svd.one * 1e9, 60, true});
    g.push_back({"svd3_f32_speedup", "  over torch::linalg_svd", svd.speedup(), 40, false});
  }
  if (options.measures("mpm")) {
    const std::int64_t n = options.mpm_goal_particles;
    const BenchRow& forward = *report.find("mpm step", "forward", n);
    const BenchRow& backward = *report.find("mpm step", "backward", n);
    g.push_back({"mpm_step_f32_fwd_ns", "P2G + grid + G2P, ns a particle-step forward",
                 forward.one * 1e9, 120, true});
    g.push_back({"mpm_step_f32_bwd_ns", "  backward", backward.one * 1e9, 250, true});
    g.push_back({"mpm_step_speedup", "  over plain tensors, both passes",
                 speedup_of_both(forward, backward), 20, false});
  }
  if (options.measures("learned")) add_learned(report, g);
  if (options.measures("epoch")) add_epochs(report, g);
  Extremes gain;
  for (const BenchRow& row : report.rows) {
    if (row.particles >= kManyParticles) gain.add(row.second_core());
  }
  if (report.machine.threads > 1 && std::isfinite(gain.low)) {
    g.push_back(
        {"second_core_min", "second core, least gain from 1e4 particles on", gain.low, 1.7, false});
  }
  if (options.measures("mpm") && options.mpm_particles.size() > 1) {
    g.push_back({"per_particle_spread", "cost of a particle-step, largest size over smallest",
                 spread(report), 1.5, true});
  }
  if (options.measures("train")) {
    const BenchRow& train = *report.all("train isotropic", "both").front();
    g.push_back(
        {"train_speedup", "training, samples/s over plain tensors", train.speedup(), 5, false});
  }
  return g;
}

std::string goals_table(const std::vector<Goal>& goals) {
  std::string text = fmt::format("{:<50} {:>10} {:>10}  {}\n", "work", "goal", "measured", "");
  for (const Goal& goal : goals) {
    const bool bound = std::isfinite(goal.bound);
    text += fmt::format("{:<50} {:>10} {:>10}  {}\n", goal.work,
                        bound ? fmt::format("{} {:g}", goal.at_most ? "<=" : ">=", goal.bound) : "",
                        fmt::format("{:.4g}", goal.measured),
                        !bound          ? ""
                        : goal.passes() ? "pass"
                                        : "short");
  }
  return text;
}

}  // namespace uniphy::bench
