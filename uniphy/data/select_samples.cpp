#include "uniphy/data/select_samples.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "ops/kernels/base/statistics.hpp"

namespace uniphy {
namespace {

using Indices = std::vector<std::int64_t>;

constexpr int kStrainParts = 8;
constexpr int kSecondParts = 4;
/// Strains and rates below this are one and the same: rounding of F = I.
constexpr double kFloor = 1e-7;

/// Moves `count` random members of `from` to the end of `to`.
void take(Indices& from, std::int64_t count, UniformRandom& random, Indices& to) {
  for (std::int64_t k = 0; k < count; ++k) {
    const std::size_t i = random.below(from.size());
    to.push_back(from[i]);
    from[i] = from.back();
    from.pop_back();
  }
}

/// Sorts indices into `parts` equal parts of the range of log(value).
template <class Value>
std::vector<Indices> cut(const Indices& indices, int parts, const Value& value) {
  std::vector<Indices> result(static_cast<std::size_t>(parts));
  if (indices.empty()) return result;
  std::vector<double> logs;
  for (const std::int64_t i : indices) logs.push_back(std::log(std::max(kFloor, value(i))));
  const double low = kernels::quantile(logs, 0.005), high = kernels::quantile(logs, 0.995);
  for (std::size_t k = 0; k < indices.size(); ++k) {
    const double place = high > low ? (logs[k] - low) / (high - low) * parts : 0;
    const auto part = static_cast<std::size_t>(std::clamp(place, 0.0, parts - 1.0));
    result[part].push_back(indices[k]);
  }
  return result;
}

std::vector<std::int64_t> sizes(const std::vector<Indices>& parts) {
  std::vector<std::int64_t> result;
  for (const Indices& part : parts) result.push_back(static_cast<std::int64_t>(part.size()));
  return result;
}

}  // namespace

std::vector<std::int64_t> fill_evenly(const std::vector<std::int64_t>& capacity,
                                      std::int64_t total) {
  std::vector<std::size_t> order(capacity.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return capacity[a] < capacity[b]; });
  std::vector<std::int64_t> share(capacity.size(), 0);
  auto vessels = static_cast<std::int64_t>(order.size());
  for (const std::size_t i : order) {
    // Rounded up, so that what does not divide is spent early on those that can hold it.
    share[i] = std::min(capacity[i], (total + vessels - 1) / vessels);
    total -= share[i];
    --vessels;
  }
  return share;
}

std::vector<std::int64_t> level_up(const std::vector<std::int64_t>& counts,
                                   const std::vector<bool>& open, std::int64_t total) {
  std::vector<std::int64_t> added(counts.size(), 0);
  if (std::find(open.begin(), open.end(), true) == open.end()) return added;
  for (; total > 0; --total) {
    std::size_t least = counts.size();
    for (std::size_t i = 0; i < counts.size(); ++i) {
      if (!open[i]) continue;
      if (least == counts.size() || counts[i] + added[i] < counts[least] + added[least]) least = i;
    }
    ++added[least];
  }
  return added;
}

std::vector<std::int64_t> select_samples(const std::vector<SampleFeatures>& features, int branches,
                                         std::int64_t count, double uniform_share,
                                         double first_share, UniformRandom& random) {
  Indices rest(features.size()), chosen;
  std::iota(rest.begin(), rest.end(), 0);
  count = std::min<std::int64_t>(count, static_cast<std::int64_t>(rest.size()));
  const std::int64_t uniform = std::llround(uniform_share * static_cast<double>(count));
  take(rest, uniform, random, chosen);

  std::vector<Indices> by_branch(static_cast<std::size_t>(branches));
  for (const std::int64_t i : rest) {
    by_branch[static_cast<std::size_t>(features[static_cast<std::size_t>(i)].branch)].push_back(i);
  }
  const auto feature = [&](std::int64_t i) -> const SampleFeatures& {
    return features[static_cast<std::size_t>(i)];
  };
  auto of_branch = fill_evenly(sizes(by_branch), count - uniform);
  const std::int64_t first = std::llround(first_share * static_cast<double>(count - uniform));
  if (of_branch[0] > first) {
    // What the others cannot take stays with the first.
    auto others = sizes(by_branch);
    others[0] = 0;
    of_branch = fill_evenly(others, count - uniform - first);
    of_branch[0] =
        count - uniform - std::accumulate(of_branch.begin(), of_branch.end(), std::int64_t{0});
  }
  for (std::size_t b = 0; b < by_branch.size(); ++b) {
    auto by_strain =
        cut(by_branch[b], kStrainParts, [&](std::int64_t i) { return feature(i).strain; });
    const auto of_strain = fill_evenly(sizes(by_strain), of_branch[b]);
    for (std::size_t s = 0; s < by_strain.size(); ++s) {
      auto cells =
          cut(by_strain[s], kSecondParts, [&](std::int64_t i) { return feature(i).second; });
      const auto of_cell = fill_evenly(sizes(cells), of_strain[s]);
      for (std::size_t c = 0; c < cells.size(); ++c) take(cells[c], of_cell[c], random, chosen);
    }
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

}  // namespace uniphy
