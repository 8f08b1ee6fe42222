#include "uniphy/bench/bench_options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/laws/law_table.hpp"

namespace uniphy::bench {

bool BenchOptions::measures(const std::string& subject) const {
  return std::find(subjects.begin(), subjects.end(), subject) != subjects.end();
}

namespace {

std::vector<std::int64_t> sizes(Section& section, const std::vector<std::int64_t>& fallback,
                                const Range& range, const std::string& doc) {
  const auto all =
      section.integers("particles", fallback, range, "", doc + ", each once", between(1, 20));
  if (std::set<std::int64_t>(all.begin(), all.end()).size() < all.size()) {
    section.fail("particles",
                 fmt::format("expected different sizes, found {}", fmt::join(all, ", ")));
  }
  return all;
}

}  // namespace

BenchOptions read_bench_options(Section& config) {
  BenchOptions o;
  const std::vector<std::string> subjects{"svd", "laws", "learned", "mpm", "epoch", "train"};
  o.subjects = config.choices("subjects", subjects, subjects,
                              "what is measured, besides the machine's own limits", at_least(1));
  o.effort.rounds = static_cast<int>(
      config.integer("rounds", 30, between(1, 1000), "",
                     "times that everything is measured; the shortest time counts"));
  o.effort.seconds = config.real("seconds", 0.003, between(1e-6, 100), "s",
                                 "least duration of one measurement in a round");
  o.effort.budget = config.real("budget", 4, between(0, 1e6), "s",
                                "work that took so long already sits out the later rounds");
  Section machine = config.section("machine", "the limits of this machine");
  o.copy_mb = machine.integer("copy_mb", 256, between(1, 65536), "MiB",
                              "size of the copy; more than the caches hold");
  Section svd = config.section("svd", "3x3 singular value decompositions");
  o.svd_matrices = svd.integer("matrices", 100000, between(1, 1e8), "", "of one call");

  Section laws = config.section("laws", "analytic laws: projection and stress");
  std::vector<std::string> names;
  for (int id = 0; id < kernels::kAnalyticLaws; ++id) {
    names.emplace_back(kernels::law_name(static_cast<kernels::LawId>(id)));
  }
  o.laws = laws.choices("names", names, names, "which", at_least(1));
  o.law_particles = laws.integer("particles", 10000, between(1, 1e8), "", "of one call");

  Section learned = config.section("learned", "the learned law in both forms, random weights");
  o.learned_particles = sizes(learned, {1000, 10000}, between(1, 1e8), "of one call");

  Section mpm = config.section("mpm", "P2G, grid and G2P in a roll-out, 8 particles a cell");
  o.mpm_particles =
      sizes(mpm, {1000, 10000, 100000, 1000000}, between(8, 1e8), "sizes of the body");
  o.mpm_goal_particles =
      mpm.integer("goal_particles", 100000, between(8, 1e8), "",
                  "the size that the goals are about and that the plain version runs");
  o.mpm_steps = mpm.integer("steps", 32, between(1, 100000), "", "of one call");
  if (!config.describing() && o.measures("mpm") &&
      std::find(o.mpm_particles.begin(), o.mpm_particles.end(), o.mpm_goal_particles) ==
          o.mpm_particles.end()) {
    mpm.fail("goal_particles", fmt::format("expected one of mpm.particles, {}, found {}",
                                           fmt::join(o.mpm_particles, ", "), o.mpm_goal_particles));
  }

  Section epoch = config.section("epoch", "one epoch of Algorithm 2 on the benchmark cube");
  o.epoch_side = epoch.integer("per_side", 10, between(2, 200), "", "particles along an edge");
  o.epoch_steps =
      epoch.integer("steps", 1000, between(5, 1e6), "", "steps of 0.5 ms, a multiple of 5");
  if (o.epoch_steps % kEpochStride != 0) {
    epoch.fail("steps",
               fmt::format("expected a multiple of {}, found {}", kEpochStride, o.epoch_steps));
  }
  o.epoch_rounds = epoch.integer("rounds", 2, between(1, 1000), "", "times that it is measured");
  o.epoch_plain_steps =
      epoch.integer("plain_steps", 4, between(1, 1e6), "",
                    "steps of the plain version, from which its epoch is extrapolated");

  Section train = config.section("train", "steps of Algorithm 1, isotropic form");
  o.train_trajectories =
      train.integer("trajectories", 200, between(1, 1e6), "", "that every step sees");
  o.train_batch = train.integer("batch_per_trajectory", 64, between(1, 1e6), "", "samples of each");
  return o;
}

}  // namespace uniphy::bench
