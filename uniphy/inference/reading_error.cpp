#include "uniphy/inference/reading_error.hpp"

#include <algorithm>
#include <cmath>

#include "ops/kernels/base/for_each.hpp"

namespace uniphy {
namespace {

/// Codes that are looked at, at most: what 90 % of 40 stay below is known to a third.
constexpr std::size_t kMostCodes = 40;

struct Pair {
  MaterialReading learned, analytic;
};

std::vector<int> codes_of(const FitVariables& variables, const std::string& material) {
  std::vector<int> codes;
  for (int i = 0; i < variables.starts(); ++i) {
    if (variables.label(i) == material && variables.origin(i)) codes.push_back(i);
  }
  const std::size_t stride = (codes.size() + kMostCodes - 1) / kMostCodes;
  std::vector<int> some;
  for (std::size_t k = 0; k < codes.size(); k += stride) some.push_back(codes[k]);
  return some;
}

/// Of positive numbers.
double log_ratio(double a, double b) { return a > 0 && b > 0 ? std::log(a / b) : std::nan(""); }

}  // namespace

MaterialReading reading_error(const FitVariables& variables, const std::string& material, double dt,
                              double strain_seen) {
  const std::vector<int> codes = codes_of(variables, material);
  std::vector<Pair> pairs(codes.size());
  kernels::for_each(static_cast<std::ptrdiff_t>(codes.size()), [&](std::ptrdiff_t k) {
    pairs[k] = {read_material(variables.law(variables.start(codes[k])), dt, strain_seen),
                read_material(*variables.origin(codes[k]), dt, strain_seen)};
  });
  MaterialReading error;
  error.material = material;
  for (const ReadingNumber& n : reading_numbers()) {
    std::vector<double> off;
    for (const Pair& p : pairs) {
      if (p.learned.material != material || p.analytic.material != material) continue;
      const double ratio = std::abs(log_ratio(p.learned.*n.value, p.analytic.*n.value));
      if (!std::isnan(ratio)) off.push_back(ratio);
    }
    if (off.empty()) continue;
    const auto at = off.begin() + static_cast<std::ptrdiff_t>(kReadingShare *
                                                              static_cast<double>(off.size() - 1));
    std::nth_element(off.begin(), at, off.end());
    error.*n.value = *at;
  }
  return error;
}

MaterialBelief with_reading_error(const MaterialBelief& belief, const MaterialReading& error) {
  MaterialBelief wider = belief;
  for (const ReadingNumber& n : reading_numbers()) {
    const double value = belief.reading.*n.value;
    // The value found may lie at an end of what was drawn, or beyond it.
    const double below = log_ratio(value, std::min(belief.low.*n.value, value));
    const double above = log_ratio(std::max(belief.high.*n.value, value), value);
    if (std::isnan(below + above + error.*n.value)) continue;
    wider.low.*n.value = value * std::exp(-std::hypot(below, error.*n.value));
    wider.high.*n.value = value * std::exp(std::hypot(above, error.*n.value));
  }
  return wider;
}

}  // namespace uniphy
