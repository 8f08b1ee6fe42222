#pragma once

#include <string>
#include <utility>
#include <vector>

#include "uniphy/inference/material_reading.hpp"

namespace uniphy {

/// What a motion says that a body is made of: how likely each material is, and how well its numbers
/// are known.
struct MaterialBelief {
  MaterialReading reading;  ///< of the most likely material
  /// Between these are 90 % of the samples of that material; NaN where there are less than
  /// kLeastSamples of them, or half of them have no such number.
  MaterialReading low, high;
  /// Share of the samples that behave like each material, largest first; empty without samples.
  std::vector<std::pair<std::string, double>> probability;
};

/// From the reading of the law found and of laws drawn from the posterior. Where most of these
/// behave like another material than the law found, the reading is the medians of those.
MaterialBelief material_belief(const MaterialReading& found,
                               const std::vector<MaterialReading>& samples);

inline constexpr int kLeastSamples = 10;

/// The material with its probability and a line a number: value, unit, interval. What it does not
/// have is "n/a".
std::string belief_text(const MaterialBelief& belief);

}  // namespace uniphy
