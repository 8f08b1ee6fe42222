#include "uniphy/stability/stability_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "uniphy/stability/methods.hpp"

namespace uniphy::stability {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// One row and column.
struct Group {
  std::int64_t all = 0, holds = 0, stops = 0, chaos = 0, local = 0;
  double worst = kNone;     ///< of the deciding number
  double finite = 1;        ///< the least share of finite gradients
  double derivative = 1;    ///< the least share of states with a derivative
  bool not_finite = false;  ///< a state of a roll-out
  std::string deciding;

  double share() const {
    return all > 0 ? static_cast<double>(holds) / static_cast<double>(all) : kNone;
  }
};

/// The one deciding number of which less is worse.
bool less_is_worse(const std::string& name) { return name == "least_dissipation"; }

Group group_of(const std::vector<Cell>& cells, const std::string& stressor,
               const std::string& method) {
  Group g;
  for (const Cell& c : cells) {
    if (c.stressor != stressor || c.method != method) continue;
    ++g.all;
    g.holds += c.verdict == Verdict::holds ? 1 : 0;
    g.stops += c.verdict == Verdict::stops ? 1 : 0;
    g.chaos += c.find("chaos").value_or(0) != 0 ? 1 : 0;
    g.local += c.find("local").value_or(0) != 0 ? 1 : 0;
    g.deciding = c.deciding;
    g.finite = std::min(g.finite, c.find("finite_share").value_or(1));
    g.derivative = std::min(g.derivative, c.find("derivative_share").value_or(1));
    const double value = c.decided();
    if (std::isnan(value)) {
      g.not_finite = g.not_finite || (c.find(c.deciding) && c.verdict == Verdict::fails);
      continue;
    }
    const bool worse = less_is_worse(c.deciding) ? value < g.worst : value > g.worst;
    if (std::isnan(g.worst) || worse) g.worst = value;
  }
  return g;
}

std::vector<std::string> rows_of(const std::vector<Cell>& cells) {
  std::vector<std::string> rows;
  for (const Cell& c : cells) {
    if (std::find(rows.begin(), rows.end(), c.stressor) == rows.end()) rows.push_back(c.stressor);
  }
  return rows;
}

std::vector<Method> columns_of(const std::vector<Cell>& cells) {
  std::vector<Method> columns;
  for (const Method& m : kMethods) {
    if (std::any_of(cells.begin(), cells.end(), [&](const Cell& c) { return c.method == m.name; }))
      columns.push_back(m);
  }
  return columns;
}

/// The number behind a verdict: what is not finite first, then what has no derivative.
std::string number_of(const Group& g) {
  if (g.finite < 1) return fmt::format("finite {:.2g}", g.finite);
  if (g.derivative < kDerivativeShare) return fmt::format("no derivative {:.2g}", 1 - g.derivative);
  if (g.not_finite) return "not finite";
  return std::isnan(g.worst) ? "–" : fmt::format("{:.2g}", g.worst);
}

std::string entry(const Group& g) {
  if (g.all == 0) return " – |";
  std::string text =
      fmt::format(" {} {}/{}", g.holds == g.all ? "holds" : "**fails**", g.holds, g.all);
  if (g.holds + g.stops == g.all && g.holds < g.all)
    text = fmt::format(" stops {}/{}", g.holds, g.all);
  text += "; " + number_of(g);
  if (g.holds + g.stops < g.all && g.stops > 0) text += fmt::format("; {} stop", g.stops);
  if (g.chaos > 0) text += fmt::format("; {} chaotic", g.chaos);
  if (g.local > 0) text += fmt::format("; {} local", g.local);
  return text + " |";
}

std::string rotation_table(const std::vector<Cell>& cells) {
  std::string text;
  for (const Cell& c : cells) {
    if (c.setting != "U V^T") continue;
    text += fmt::format("| {} | {} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} |\n", c.stressor,
                        c.method, c.find("finite_share").value_or(kNone),
                        c.find("gradient_error_together").value_or(kNone),
                        c.find("gradient_error_median").value_or(kNone), c.decided(),
                        c.find("factor_gradient").value_or(kNone));
  }
  if (text.empty()) return text;
  return "\nGradient through U Vᵀ, and through U and V themselves:\n\n| F | method | finite | "
         "error "
         "of all together | median | largest | largest entry by U, V "
         "|\n|---|---|---|---|---|---|---|\n" +
         text;
}

/// Quoted as RFC 4180 has it.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  return out + "\"";
}

bool by_default(const Cell& c) {
  return (c.method == "analytic" || c.method == "isotropic" || c.method == "exported") &&
         c.stressor != "time_step_beyond";
}

template <class Keep>
void add_summary(const std::vector<Cell>& cells, const std::string& count,
                 const std::string& survived, const std::string& suffix, const Keep& keep,
                 Metrics& metrics) {
  double all = 0, holds = 0, finite = kNone, error = kNone;
  for (const Cell& c : cells) {
    if (!keep(c)) continue;
    all += 1;
    holds += c.verdict == Verdict::holds ? 1 : 0;
    const auto share = c.find("finite_share");
    if (!share) continue;
    finite = std::isnan(finite) ? *share : std::min(finite, *share);
    if (!std::isnan(c.decided()))
      error = std::isnan(error) ? c.decided() : std::max(error, c.decided());
  }
  if (all == 0) return;
  metrics.set(count, all);
  metrics.set(survived, holds);
  if (std::isnan(finite)) return;
  metrics.set("gradient_finite_share" + suffix, finite);
  metrics.set("gradient_error_max" + suffix, error);
}

}  // namespace

std::string survival_table(const std::vector<Cell>& cells) {
  const std::vector<Method> columns = columns_of(cells);
  std::string text = "| stressor | judged by |", line = "|---|---|";
  for (const Method& m : columns) {
    text += fmt::format(" {} |", m.name);
    line += "---|";
  }
  text += "\n" + line + "\n";
  for (const std::string& row : rows_of(cells)) {
    std::string deciding, entries;
    for (const Method& m : columns) {
      const Group g = group_of(cells, row, m.name);
      if (!g.deciding.empty()) deciding = g.deciding;
      entries += entry(g);
    }
    text += fmt::format("| {} | {} |{}\n", row, deciding, entries);
  }
  text += rotation_table(cells);
  text +=
      "\nholds n/N: settings that hold of all, and the worst number; stops: the others end with an "
      "error that names what is wrong; fails: something is wrong in silence. finite: the least "
      "share of finite gradients of a setting. local: the gradient is right, but the motion bends "
      "within 1e-5 of the parameter; chaotic: difference quotients disagree among themselves.\n\n";
  for (const Method& m : columns) text += fmt::format("- {}: {}.\n", m.name, m.text);
  return text;
}

std::string numbers_csv(const std::vector<Cell>& cells) {
  std::string text = "stressor,method,setting,verdict,number,value\n";
  for (const Cell& c : cells) {
    for (const auto& [name, value] : c.numbers) {
      text += fmt::format("{},{},{},{},{},{:.9g}\n", c.stressor, c.method, quoted(c.setting),
                          verdict_name(c.verdict), name, value);
    }
  }
  return text;
}

std::string failures_csv(const std::vector<Cell>& cells) {
  std::string text = "method,stressor,setting,verdict,step,particle,cause\n";
  const auto number = [](std::int64_t n) { return n < 0 ? std::string() : std::to_string(n); };
  for (const Cell& c : cells) {
    if (c.verdict == Verdict::holds) continue;
    text += fmt::format("{},{},{},{},{},{},{}\n", c.method, c.stressor, quoted(c.setting),
                        verdict_name(c.verdict), number(c.failure.step), number(c.failure.particle),
                        quoted(c.failure.cause));
  }
  return text;
}

ValueMap survival_map(const std::vector<Cell>& cells) {
  ValueMap map;
  map.title = "Share of the settings that hold";
  map.rows = rows_of(cells);
  for (const Method& m : columns_of(cells)) map.columns.emplace_back(m.name);
  for (const std::string& row : map.rows) {
    for (const std::string& column : map.columns) {
      const Group g = group_of(cells, row, column);
      map.values.push_back(g.share());
      map.texts.push_back(g.all == 0 ? ""
                                     : fmt::format("{}/{}{}", g.holds, g.all,
                                                   g.stops > 0 ? fmt::format(", {} stop", g.stops)
                                                               : std::string()));
    }
  }
  return map;
}

void add_stability_metrics(const std::vector<Cell>& cells, Metrics& metrics) {
  for (const std::string& row : rows_of(cells)) {
    for (const Method& m : columns_of(cells)) {
      const Group g = group_of(cells, row, m.name);
      if (g.all == 0) continue;
      metrics.set(fmt::format("survives.{}.{}", row, m.name), g.share());
      if (g.deciding == "gradient_error")
        metrics.set(fmt::format("gradient_error.{}.{}", row, m.name), g.worst);
    }
  }
  for (const Method& m : columns_of(cells)) {
    const std::string name = m.name;
    add_summary(
        cells, "cells." + name, "cells_survived." + name, "." + name,
        [&](const Cell& c) { return c.method == name; }, metrics);
  }
  add_summary(cells, "cells_default", "cells_default_survived", "", by_default, metrics);
}

}  // namespace uniphy::stability
