#include "uniphy/data/simulate_samples.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/statistics.hpp"
#include "uniphy/data/drawn_states.hpp"
#include "uniphy/data/law_branches.hpp"
#include "uniphy/data/select_samples.hpp"

namespace uniphy {
namespace {

using kernels::LawDescription;

constexpr double kLargestEntry = 1e3;  ///< of F
constexpr double kEqualPart = 0.25;    ///< of the drawn states goes to all branches alike
/// However small the strains of a trajectory, drawn ones reach this.
constexpr double kLeastDrawnStrain = 0.01;
/// What a trajectory "saw" of strain and stress: a few wild particles do not count.
constexpr double kHighQuantile = 0.995;
/// Of the samples that are spread over branches, at most this part at rest.
constexpr double kRestShare = 0.1;

void append_rows(const LawSamples& from, const std::vector<std::int64_t>& rows, LawSamples& to) {
  const auto copy = [&](const std::vector<double>& source, std::vector<double>& target) {
    target.reserve(target.size() + 9 * rows.size());
    for (const std::int64_t row : rows) {
      target.insert(target.end(), source.begin() + 9 * row, source.begin() + 9 * (row + 1));
    }
  };
  copy(from.F, to.F);
  copy(from.F_proj, to.F_proj);
  copy(from.C, to.C);
  copy(from.tau, to.tau);
}

void append_all(const LawSamples& from, LawSamples& to) {
  to.F.insert(to.F.end(), from.F.begin(), from.F.end());
  to.F_proj.insert(to.F_proj.end(), from.F_proj.begin(), from.F_proj.end());
  to.C.insert(to.C.end(), from.C.begin(), from.C.end());
  to.tau.insert(to.tau.end(), from.tau.begin(), from.tau.end());
}

void check_candidates(std::ptrdiff_t step, const kernels::LawSample<double>& sample) {
  for (std::size_t k = 0; k < sample.F_trial.size(); ++k) {
    // Written so that NaN fails too.
    if (std::abs(sample.F_trial[k]) < kLargestEntry && std::isfinite(sample.tau[k])) continue;
    throw Error(
        fmt::format("particle {} at step {}: deformation gradient {} and stress {} Pa "
                    "(the run is not stable)",
                    k / 9, step, sample.F_trial[k], sample.tau[k]));
  }
}

std::vector<std::int64_t> count_branches(const std::vector<SampleFeatures>& features,
                                         const std::vector<std::int64_t>& rows,
                                         std::size_t branches) {
  std::vector<std::int64_t> counts(branches, 0);
  for (const std::int64_t row : rows) {
    ++counts[static_cast<std::size_t>(features[static_cast<std::size_t>(row)].branch)];
  }
  return counts;
}

DrawnStateRanges drawn_ranges(const GenerateOptions& options, const LawSamples& candidates,
                              const std::vector<SampleFeatures>& features) {
  std::vector<double> strains, stresses;
  for (const SampleFeatures& f : features) strains.push_back(f.strain);
  for (std::size_t k = 0; k < candidates.tau.size(); k += 9) {
    stresses.push_back(std::sqrt(kernels::sum_of_squares(&candidates.tau[k], 9)));
  }
  const double strain = kernels::quantile(std::move(strains), kHighQuantile);
  DrawnStateRanges ranges;
  ranges.strain =
      std::min(options.drawn_strain, std::max(kLeastDrawnStrain, options.drawn_beyond * strain));
  ranges.yield_strain = std::max(options.drawn_strain, strain);
  ranges.stress = options.drawn_beyond * kernels::quantile(std::move(stresses), kHighQuantile);
  ranges.step = options.drawn_step;
  ranges.affine_low = options.drawn_affine[0];
  ranges.affine_high = options.drawn_affine[1];
  return ranges;
}

/// Drawn states of each branch, given the simulated samples of each.
std::vector<std::int64_t> drawn_shares(const TrajectorySetup& setup, const DrawnStateRanges& ranges,
                                       std::vector<std::int64_t> simulated, std::int64_t drawn,
                                       bool rests) {
  std::vector<bool> open(simulated.size());
  std::vector<std::int64_t> room(simulated.size(), 0);
  for (std::size_t b = 0; b < open.size(); ++b) {
    open[b] = branch_reachable(setup.law(), setup.record.dt, static_cast<int>(b), ranges);
    if (open[b]) room[b] = drawn;
  }
  std::vector<std::int64_t> shares =
      fill_evenly(room, std::llround(kEqualPart * static_cast<double>(drawn)));
  std::int64_t left = drawn;
  for (std::size_t b = 0; b < shares.size(); ++b) {
    simulated[b] += shares[b];
    left -= shares[b];
  }
  if (rests) open[0] = false;  // states at rest say little
  const auto more = level_up(simulated, open, left);
  for (std::size_t b = 0; b < shares.size(); ++b) shares[b] += more[b];
  return shares;
}

}  // namespace

LawSamples simulate_candidates(const TrajectorySetup& setup, std::int64_t every) {
  const PlacedScene placed = place_scene(setup.scene);
  Scene<double> scene = build_scene<double>(setup.scene, placed);
  LawSamples candidates;
  kernels::RunOptions<double> run;
  run.sample_step = [every](std::ptrdiff_t step) { return step % every == every - 1; };
  run.on_sample = [&](std::ptrdiff_t step, const kernels::LawSample<double>& sample) {
    check_candidates(step, sample);
    const auto add = [](const std::vector<double>& from, std::vector<double>& to) {
      to.insert(to.end(), from.begin(), from.end());
    };
    add(sample.F_trial, candidates.F);
    add(sample.F_proj, candidates.F_proj);
    add(sample.C, candidates.C);
    add(sample.tau, candidates.tau);
  };
  scene.rollout.run(scene.initial, placed.steps, run);
  return candidates;
}

LawSamples trajectory_samples(const GenerateOptions& options, const TrajectorySetup& setup,
                              std::uint64_t seed) {
  UniformRandom random(seed);
  const LawSamples candidates = simulate_candidates(setup, options.every);
  const std::vector<SampleFeatures> features = sample_features(setup.law(), candidates);
  const std::vector<std::string>& branches = branch_names(setup.law().id);
  const bool rests = branches.front() == "rest";

  const std::int64_t drawn =
      std::llround(options.drawn_share * static_cast<double>(options.samples));
  const auto rows =
      select_samples(features, static_cast<int>(branches.size()), options.samples - drawn,
                     options.uniform_share, rests ? kRestShare : 1, random);
  LawSamples samples;
  append_rows(candidates, rows, samples);
  samples.source.assign(rows.size(), kSimulatedSample);

  const DrawnStateRanges ranges = drawn_ranges(options, candidates, features);
  const auto shares =
      drawn_shares(setup, ranges, count_branches(features, rows, branches.size()), drawn, rests);
  for (std::size_t b = 0; b < branches.size(); ++b) {
    append_all(
        draw_states(setup.law(), setup.record.dt, static_cast<int>(b), shares[b], ranges, random),
        samples);
  }
  samples.source.resize(static_cast<std::size_t>(samples.size()), kDrawnSample);
  return samples;
}

}  // namespace uniphy
