#include "uniphy/data/dataset_metrics.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "ops/kernels/base/statistics.hpp"

namespace uniphy {
namespace {

constexpr double kLargeAffine = 10;  ///< 1/s

bool is_yielding(const std::string& branch) {
  return branch == "yield" || branch == "yield_near" || branch == "apex";
}

std::int64_t sum(const std::vector<std::int64_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::int64_t{0});
}

double ratio(std::int64_t part, std::int64_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

/// A family with the branches that a random law of this kind falls into; none for plastics.
std::optional<kernels::LawId> family_of(RandomLawKind kind) {
  if (kind == RandomLawKind::solid) return kernels::LawId::elastic;
  if (kind == RandomLawKind::fluid) return kernels::LawId::newtonian;
  return {};
}

std::vector<SampleFeatures> random_features(RandomLawKind kind, const LawSamples& samples) {
  kernels::LawDescription law;
  law.id = family_of(kind).value_or(kernels::LawId::elastic);
  std::vector<SampleFeatures> features = sample_features(law, samples);
  if (family_of(kind)) return features;
  for (std::size_t s = 0; s < features.size(); ++s) {
    const auto at = static_cast<std::ptrdiff_t>(9 * s);
    const bool same =
        std::equal(samples.F.begin() + at, samples.F.begin() + at + 9, samples.F_proj.begin() + at);
    features[s].branch = same ? 0 : 1;
  }
  return features;
}

}  // namespace

DatasetMetrics::Material DatasetMetrics::make(const std::string& name,
                                              const std::vector<std::string>& branches) {
  Material material;
  material.name = name;
  material.branches = branches;
  material.simulated.assign(branches.size(), 0);
  material.drawn = material.simulated;
  return material;
}

DatasetMetrics::DatasetMetrics(const GenerateOptions& options) : dt_(options.dt.value_or(0)) {
  for (const MaterialRanges& ranges : options.materials)
    materials_.push_back(make(ranges.name(), branch_names(ranges.id)));
  for (const RandomLawKind kind : kRandomLawKinds) {
    if (options.random_laws[static_cast<std::size_t>(kind)] == 0) continue;
    const auto family = family_of(kind);
    materials_.push_back(
        make(random_law_name(kind),
             family ? branch_names(*family) : std::vector<std::string>{"elastic", "yield"}));
  }
}

DatasetMetrics::Material& DatasetMetrics::find(const std::string& name) {
  return *std::find_if(materials_.begin(), materials_.end(),
                       [&](const Material& m) { return m.name == name; });
}

void DatasetMetrics::add(const TrajectorySetup& setup, const TrajectoryPart& part) {
  add(find(setup.record.material), sample_features(setup.law(), part.samples), part);
  if (setup.record.dt < dt_) ++dt_lowered_;
}

void DatasetMetrics::add(RandomLawKind kind, const TrajectoryPart& part) {
  add(find(random_law_name(kind)), random_features(kind, part.samples), part);
}

void DatasetMetrics::add(Material& material, const std::vector<SampleFeatures>& features,
                         const TrajectoryPart& part) {
  bool yields = false;
  for (std::size_t s = 0; s < features.size(); ++s) {
    const auto branch = static_cast<std::size_t>(features[s].branch);
    const bool simulated = part.samples.source[s] == kSimulatedSample;
    ++(simulated ? material.simulated : material.drawn)[branch];
    yields = yields || (simulated && is_yielding(material.branches[branch]));
    material.strains.push_back(features[s].strain);
    if (kernels::sum_of_squares(&part.samples.C[9 * s], 9) > kLargeAffine * kLargeAffine)
      ++material.large_affine;
  }
  ++material.trajectories;
  material.yielding += yields ? 1 : 0;
  material.failed += static_cast<std::int64_t>(part.failures.size());
}

void DatasetMetrics::write(Metrics& metrics) const {
  std::int64_t trajectories = 0, samples = 0;
  for (const Material& m : materials_) {
    trajectories += m.trajectories;
    samples += sum(m.simulated) + sum(m.drawn);
  }
  metrics.set("trajectories", static_cast<double>(trajectories));
  metrics.set("samples", static_cast<double>(samples));
  metrics.set("dt_lowered", static_cast<double>(dt_lowered_));
  for (const Material& m : materials_) {
    const std::string& name = m.name;
    const auto& branches = m.branches;
    const std::int64_t simulated = sum(m.simulated), all = simulated + sum(m.drawn);
    metrics.set("failed." + name, static_cast<double>(m.failed));
    metrics.set("simulated." + name, static_cast<double>(simulated));
    metrics.set("drawn." + name, static_cast<double>(all - simulated));
    if (simulated > 0 && std::any_of(branches.begin(), branches.end(), is_yielding)) {
      metrics.set("yielding." + name, ratio(m.yielding, m.trajectories));
    }
    for (std::size_t b = 0; b < branches.size(); ++b) {
      metrics.set("share." + name + "." + branches[b], ratio(m.simulated[b] + m.drawn[b], all));
      metrics.set("share_simulated." + name + "." + branches[b], ratio(m.simulated[b], simulated));
    }
    metrics.set("large_affine." + name, ratio(m.large_affine, all));
    if (m.strains.empty()) continue;
    metrics.set("strain_low." + name, kernels::quantile(m.strains, 0.01));
    metrics.set("strain_median." + name, kernels::quantile(m.strains, 0.5));
    metrics.set("strain_high." + name, kernels::quantile(m.strains, 0.99));
  }
}

}  // namespace uniphy
