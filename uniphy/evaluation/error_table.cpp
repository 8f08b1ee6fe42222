#include "uniphy/evaluation/error_table.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

namespace uniphy {
namespace {

std::string plain(double value) {
  if (!std::isfinite(value)) return "fails";
  return value == 0 ? "0" : fmt::format("{:.0e}", value);
}

}  // namespace

std::string percent(double value) {
  if (!std::isfinite(value)) return "fails";
  if (value == 0) return "0";
  return value < 0.995 ? fmt::format("{:.2g} %", 100 * value)
                       : fmt::format("{:.0f} %", 100 * value);
}

std::string error_table(const std::vector<ErrorRow>& rows,
                        const std::vector<std::string>& materials) {
  std::string text = "| |", rule = "|---|";
  for (const std::string& material : materials) {
    text += " " + material + " |";
    rule += "---|";
  }
  text += "\n" + rule + "\n";
  for (const ErrorRow& row : rows) {
    text += "| " + row.title + " |";
    const bool projection = row.name.find("projection_error") != std::string::npos;
    for (const std::string& material : materials) {
      const auto show = projection && material == "elastic" ? plain : percent;
      const auto value = [&](const char* ending) {
        const auto found = row.metrics->find(row.name + "." + material + ending);
        return found.value_or(std::numeric_limits<double>::quiet_NaN());
      };
      text += fmt::format(" {} ({}) |", show(value("")), show(value(".worst")));
    }
    text += "\n";
  }
  return text;
}

}  // namespace uniphy
