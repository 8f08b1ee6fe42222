#include "uniphy/inference/rung_report.hpp"

#include <fmt/format.h>

namespace uniphy {

std::string rung_table(Rung chosen, const std::vector<RungReport>& rungs) {
  if (rungs.empty()) return "";
  std::string text = fmt::format("{:<9} {:>10} {:>10} {:>9} {:>8}\n", "rung", "fitted", "kept",
                                 "roll-outs", "seconds");
  for (const RungReport& r : rungs) {
    text += fmt::format("{:<9} {:>8.4f} % {:>8.4f} % {:>9} {:>8.1f}{}\n", rung_name(r.rung),
                        100 * r.fitted, 100 * r.kept, r.roll_outs, r.seconds,
                        r.rung == chosen ? "  chosen" : "");
  }
  return text;
}

}  // namespace uniphy
