#pragma once

#include <cstdint>
#include <vector>

#include "uniphy/data/law_branches.hpp"
#include "uniphy/geometry/random.hpp"

namespace uniphy {

/// Cuts `total` into shares that are as equal as their `capacity` allows (water filled into vessels
/// of these sizes); they sum to min(total, Σ capacity). What cannot be split evenly goes to the
/// first ones.
std::vector<std::int64_t> fill_evenly(const std::vector<std::int64_t>& capacity,
                                      std::int64_t total);

/// What to add to `counts` so that the smallest become as equal as `total` allows; nothing is added
/// where `open` is false.
std::vector<std::int64_t> level_up(const std::vector<std::int64_t>& counts,
                                   const std::vector<bool>& open, std::int64_t total);

/// Indices of `count` samples (all, where there are fewer), in increasing order. A part
/// `uniform_share` is taken as the simulation gives them; the rest is spread evenly over the
/// branches, within a branch over eight parts of its range of strain and within those over four of
/// the second feature, both cut evenly on a logarithmic scale between the quantiles 0.005 and
/// 0.995. A branch or part that has too little leaves its share to the others. At most a part
/// `first_share` of the rest is of branch 0.
std::vector<std::int64_t> select_samples(const std::vector<SampleFeatures>& features, int branches,
                                         std::int64_t count, double uniform_share,
                                         double first_share, UniformRandom& random);

}  // namespace uniphy
