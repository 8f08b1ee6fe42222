#pragma once

#include <string>
#include <vector>

#include "uniphy/report/metrics.hpp"

namespace uniphy {

/// A relative error as text: "0.48 %", "0", "fails" where it is not finite.
std::string percent(double value);

/// A line of a table of errors.
struct ErrorRow {
  std::string title;
  const Metrics* metrics = nullptr;
  std::string name;  ///< of the metrics: "heldout_materials.stress_error"
};

/// A Markdown table: a line a row, a column a material M, "median (worst)" from `<name>.M` and
/// `<name>.M.worst`, "–" where there is none. Errors are relative, but for unprojected_error.
std::string error_table(const std::vector<ErrorRow>& rows,
                        const std::vector<std::string>& materials);

}  // namespace uniphy
