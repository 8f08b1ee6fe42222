#include "uniphy/evaluation/error_table.hpp"

#include <fmt/format.h>

#include <cmath>

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
    const bool relative = row.name.find("unprojected_error") == std::string::npos;
    const auto show = relative ? percent : plain;
    for (const std::string& material : materials) {
      const auto value = [&](const char* ending) {
        return row.metrics->find(row.name + "." + material + ending);
      };
      const auto median = value(""), worst = value(".worst");
      text += median && worst ? fmt::format(" {} ({}) |", show(*median), show(*worst)) : " – |";
    }
    text += "\n";
  }
  return text;
}

}  // namespace uniphy
