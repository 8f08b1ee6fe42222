#pragma once

#include <string>
#include <vector>

#include "uniphy/inference/material_reading.hpp"
#include "uniphy/report/metrics.hpp"

namespace uniphy {

/// What was read off the motion of one object, and what it is made of.
struct MaterialRow {
  std::string observed;   ///< how: name of an OpenWorldCase
  std::string object;     ///< unique among the rows that were observed likewise
  MaterialReading truth;  ///< of the true law, at the strains that its motion reached
  std::string material;   ///< that it was called; empty where nothing was determined
  Metrics found;          ///< of the inference, as uniphy_infer writes them; empty where it failed
};

/// Median errors and coverage of the intervals of one number over the objects that have it.
struct NumberErrors {
  std::size_t objects = 0;  ///< that have the number
  std::size_t read = 0;     ///< of these the ones where it was found, too
  std::size_t held = 0;  ///< whose 90 % interval holds the truth; without an interval it does not
  double error = 0;      ///< median of |found/truth − 1| over those read; NaN without any
  double width = 0;  ///< median of (high − low)/truth over those with an interval; NaN likewise
};
/// Of the rows that were observed like that and are made of that material (all: ""); `key` is that
/// of ReadingNumber.
NumberErrors number_errors(const std::vector<MaterialRow>& rows, const std::string& observed,
                           const std::string& material, const std::string& key);

/// A line an observation and material: named rightly, and of every number the median error, how
/// many intervals hold the truth, and how wide they are.
std::string materials_table(const std::vector<MaterialRow>& rows);
/// A line an object and number: truth, found, low, high.
std::string materials_csv(const std::vector<MaterialRow>& rows);

/// class_right.CASE, class_total.CASE, the same .CASE.MATERIAL; mu_error, lambda_error (of elastic
/// objects), yield_error (plasticine), friction_error (sand) .CASE; coverage.CASE over these four,
/// intervals.CASE how many they are; error.NUMBER.CASE.MATERIAL and coverage.NUMBER.CASE.MATERIAL.
void add_materials_metrics(const std::vector<MaterialRow>& rows, Metrics& metrics);

}  // namespace uniphy
