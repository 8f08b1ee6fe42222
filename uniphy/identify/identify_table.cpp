#include "uniphy/identify/identify_table.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>

namespace uniphy {
namespace {

struct Symbol {
  const char *name, *unit;
  double MaterialReading::*value;
};

constexpr Symbol kMu{"μ", "Pa", &MaterialReading::mu};
constexpr Symbol kLambda{"λ", "Pa", &MaterialReading::lambda};
constexpr Symbol kBulk{"κ", "Pa", &MaterialReading::lambda};
constexpr Symbol kYield{"τ_Y", "Pa", &MaterialReading::yield_stress};
constexpr Symbol kFriction{"θ", "rad", &MaterialReading::friction_angle};
constexpr Symbol kViscosity{"η", "Pa s", &MaterialReading::viscosity};

const std::vector<Symbol>& symbols_of(const std::string& material) {
  static const std::map<std::string, std::vector<Symbol>> of{
      {"elastic", {kMu, kLambda}},
      {"newtonian", {kViscosity, kBulk}},
      {"plasticine", {kMu, kYield}},
      {"sand", {kMu, kFriction}},
      {"non_newtonian", {kMu, kYield, kViscosity}}};
  return of.at(material);
}

}  // namespace

std::string reading_text(const MaterialReading& reading) {
  MaterialBelief sure;
  sure.reading = reading;
  return reading_text(sure);
}

std::string reading_text(const MaterialBelief& belief) {
  std::string text;
  for (const Symbol& s : symbols_of(belief.reading.material)) {
    const double value = belief.reading.*s.value, low = belief.low.*s.value,
                 high = belief.high.*s.value;
    if (std::isnan(value)) continue;
    if (!text.empty()) text += ", ";
    text += fmt::format("{} {:.3g}", s.name, value);
    if (!std::isnan(low)) text += fmt::format(" [{:.3g}, {:.3g}]", low, high);
    text += fmt::format(" {}", s.unit);
  }
  return text;
}

std::string identify_table(const std::vector<Identified>& rows) {
  std::string text =
      "| hidden | observed | found (probability) | its numbers, 90 % | the hidden ones | noise | "
      "fit "
      "| off the truth | elsewhere | off the truth there | time (s) |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const Identified& r : rows) {
    text += fmt::format(
        "| {} | {} | {} ({:.2f}) | {} | {} | {:.2f} % | {:.2f} % | {:.3f} % | {} | {:.3f} % | "
        "{:.1f} "
        "|\n",
        r.material, r.shape, r.named, r.probability, r.numbers, r.truth, 100 * r.noise_share,
        100 * r.fit_share, 100 * r.found_share, r.other_shape, 100 * r.resim_share, r.wall_s);
  }
  return text +
         "\nNoise of a coordinate, error of the fit to what was observed, errors of all particles "
         "against where they were, there and in the other scene: roots of means over the largest "
         "side.\n";
}

}  // namespace uniphy
