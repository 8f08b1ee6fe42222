#include "uniphy/inference/material_belief.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace uniphy {
namespace {

/// The quantile of numbers in ascending order, between two of them where it falls there.
double quantile(const std::vector<double>& sorted, double share) {
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

std::vector<double> sorted_numbers(const std::vector<MaterialReading>& readings,
                                   double MaterialReading::*number) {
  std::vector<double> numbers;
  for (const MaterialReading& m : readings) {
    if (!std::isnan(m.*number)) numbers.push_back(m.*number);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

std::string probabilities(const MaterialBelief& belief) {
  if (belief.probability.empty()) return "";
  std::string text = fmt::format(" (probability {:.2f}", belief.probability[0].second);
  for (std::size_t i = 1; i < belief.probability.size(); ++i) {
    text += fmt::format("; {} {:.2f}", belief.probability[i].first, belief.probability[i].second);
  }
  return text + ")";
}

}  // namespace

MaterialBelief material_belief(const MaterialReading& found,
                               const std::vector<MaterialReading>& samples) {
  MaterialBelief belief;
  belief.reading = found;
  if (samples.empty()) return belief;
  std::map<std::string, std::vector<MaterialReading>> of;
  for (const MaterialReading& m : samples) of[m.material].push_back(m);
  for (const auto& [material, readings] : of) {
    belief.probability.emplace_back(material, double(readings.size()) / double(samples.size()));
  }
  std::stable_sort(belief.probability.begin(), belief.probability.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  const std::string& likely = belief.probability[0].first;
  const bool of_another = likely != found.material;
  if (of_another) belief.reading = of[likely].front();
  const std::vector<MaterialReading>& same = of[likely];
  for (const ReadingNumber& n : reading_numbers()) {
    const std::vector<double> numbers = sorted_numbers(same, n.value);
    if (of_another) {
      belief.reading.*n.value =
          2 * numbers.size() < same.size() ? MaterialReading::kNone : quantile(numbers, 0.5);
    }
    if (numbers.size() < kLeastSamples || 2 * numbers.size() < same.size()) continue;
    belief.low.*n.value = quantile(numbers, 0.05);
    belief.high.*n.value = quantile(numbers, 0.95);
  }
  return belief;
}

std::string belief_text(const MaterialBelief& belief) {
  const MaterialReading& m = belief.reading;
  std::string text = fmt::format("behaves like: {}{}", m.material, probabilities(belief));
  if (m.material == "elastic") {
    text += fmt::format(", up to a shear of {:.2g} (norm of log strain), as far as it was seen",
                        m.strain_seen);
  }
  text += "\n";
  for (const ReadingNumber& n : reading_numbers()) {
    const char* name =
        m.material == "newtonian" && n.value == &MaterialReading::lambda ? "bulk modulus" : n.name;
    if (std::isnan(m.*n.value)) {
      text += fmt::format("  {} n/a\n", name);
      continue;
    }
    text += fmt::format("  {} {:.4g}{}{}", name, m.*n.value, *n.unit == '\0' ? "" : " ", n.unit);
    if (!std::isnan(belief.low.*n.value)) {
      text += fmt::format(" [{:.4g}, {:.4g}]", belief.low.*n.value, belief.high.*n.value);
    }
    text += "\n";
  }
  return text;
}

}  // namespace uniphy
