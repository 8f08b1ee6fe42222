#include "uniphy/data/material_ranges.hpp"

#include <cmath>
#include <limits>
#include <numeric>

#include "uniphy/geometry/random.hpp"

namespace uniphy {

using kernels::LawDescription;
using kernels::LawId;

const std::vector<MaterialRanges>& default_material_ranges() {
  static const std::vector<MaterialRanges> ranges{
      {LawId::elastic, {{{350, 2595196}, {500, 2580120}}}},
      {LawId::newtonian, {{{50, 1e3}, {30, 5e5}}}},
      {LawId::plasticine, {{{1e4, 1e6}, {1e4, 3e6}, {5e3, 1e4}}}},
      {LawId::sand, {{{2400, 9e6}, {2400, 9e6}, {0, 0}, {0.01, 0.4}}}},
      {LawId::non_newtonian, {{{1e3, 2e6}, {1e3, 2e6}, {1e3, 2e6}, {0, 0}, {0.1, 100}}}},
  };
  return ranges;
}

LatinHypercube::LatinHypercube(std::int64_t count, std::uint64_t seed) : count_(count) {
  UniformRandom random(seed);
  for (auto& part : part_) {
    part.resize(static_cast<std::size_t>(count));
    std::iota(part.begin(), part.end(), 0);
    // Fisher–Yates by hand: std::shuffle differs between standard libraries.
    for (std::size_t i = part.size(); i > 1; --i) std::swap(part[i - 1], part[random.below(i)]);
  }
}

MaterialParameters LatinHypercube::point(std::int64_t i, const MaterialParameters& offset) const {
  MaterialParameters unit;
  for (std::size_t k = 0; k < unit.size(); ++k) {
    const auto part = static_cast<double>(part_[k][static_cast<std::size_t>(i)]);
    unit[k] = (part + offset[k]) / static_cast<double>(count_);
  }
  return unit;
}

LawDescription material_at(const MaterialRanges& ranges, const MaterialParameters& unit) {
  LawDescription law;
  law.id = ranges.id;
  for (const kernels::LawParameter& p : kernels::law_parameters(ranges.id)) {
    const auto k = static_cast<std::size_t>(p.place);
    const auto [low, high] = ranges.interval[k];
    law.*p.member = p.member == &LawDescription::theta
                        ? low + (high - low) * unit[k]
                        : low * std::exp(std::log(high / low) * unit[k]);
  }
  return law;
}

double yield_norm(const LawDescription& law, double trace) {
  switch (law.id) {
    case LawId::plasticine:
    case LawId::non_newtonian:
      return law.tau_y / (2 * law.mu);
    case LawId::sand:
    case LawId::volume_corrected_sand: {
      if (trace > 0) return 0;
      const double sine = std::sin(law.theta);
      const double alpha = std::sqrt(2.0 / 3) * 2 * sine / (3 - sine);
      return -alpha * (3 * law.lambda + 2 * law.mu) / (2 * law.mu) * trace;
    }
    default:
      return std::numeric_limits<double>::infinity();
  }
}

double wave_speed(const LawDescription& law, double density) {
  if (law.id == LawId::newtonian) {
    return std::sqrt(7 * (2.0 / 3 * law.mu + law.lambda) / density);
  }
  return std::sqrt((law.lambda + 2 * law.mu) / density);
}

}  // namespace uniphy
