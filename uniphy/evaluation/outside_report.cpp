#include "uniphy/evaluation/outside_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "ops/kernels/base/statistics.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// What one scene of one law came to: the learned law, and the best of the wrong ones.
struct SceneResult {
  const OutsideCell* learned = nullptr;
  const OutsideCell* analytic = nullptr;

  double best_analytic() const { return analytic ? analytic->result.forecast : kNan; }
};

struct LawResult {
  std::string law;
  std::vector<std::pair<std::string, SceneResult>> scenes;
};

/// The entry of a name, added at the end where there is none.
template <class List>
auto& entry(List& list, const std::string& name) {
  const auto found =
      std::find_if(list.begin(), list.end(), [&](const auto& e) { return e.first == name; });
  if (found != list.end()) return found->second;
  list.emplace_back();
  list.back().first = name;
  return list.back().second;
}

std::vector<LawResult> by_law(const std::vector<OutsideCell>& cells) {
  std::vector<LawResult> laws;
  for (const OutsideCell& cell : cells) {
    auto law = std::find_if(laws.begin(), laws.end(),
                            [&](const LawResult& r) { return r.law == cell.law; });
    if (law == laws.end()) law = laws.insert(laws.end(), {cell.law, {}});
    SceneResult& scene = entry(law->scenes, cell.scene);
    if (cell.fitted == kLearnedLaw) {
      scene.learned = &cell;
    } else if (!scene.analytic || cell.result.forecast < scene.analytic->result.forecast) {
      scene.analytic = &cell;
    }
  }
  return laws;
}

/// The text that occurs most often; the first of several.
std::string commonest(const std::vector<std::string>& texts) {
  std::string best;
  std::ptrdiff_t most = 0;
  for (const std::string& text : texts) {
    const auto count = std::count(texts.begin(), texts.end(), text);
    if (count <= most) continue;
    most = count;
    best = text;
  }
  return best;
}

OutsideRow row_of(const LawResult& law) {
  OutsideRow row;
  row.law = law.law;
  std::vector<double> fit, forecast, rung, explained, analytic;
  std::vector<std::string> families, names;
  for (const auto& [scene, result] : law.scenes) {
    if (result.analytic) {
      analytic.push_back(result.best_analytic());
      families.push_back(result.analytic->fitted);
    }
    if (!result.learned) continue;
    const Forecast& f = result.learned->result;
    fit.push_back(f.fit);
    forecast.push_back(f.forecast);
    rung.push_back(f.rung);
    explained.push_back(f.explained ? 1 : 0);
    names.push_back(result.learned->named);
  }
  row.fit = kernels::median(fit);
  row.forecast = kernels::median(forecast);
  row.worst = forecast.empty() ? kNan : *std::max_element(forecast.begin(), forecast.end());
  row.rung = kernels::median(rung);
  row.explained = kernels::median(explained);
  row.best_analytic = kernels::median(analytic);
  row.analytic = commonest(families);
  row.named = commonest(names);
  return row;
}

std::string percent(double share) {
  if (std::isnan(share)) return "–";
  return std::isfinite(share) ? fmt::format("{:.2g} %", 100 * share) : "failed";
}

std::string rung_name(double rung) {
  constexpr const char* kNames[] = {"latent", "numbers", "weights"};
  for (int k = 0; k < 3; ++k) {
    if (rung == k) return kNames[k];
  }
  return std::isnan(rung) ? "–" : fmt::format("{:g}", rung);
}

std::string scene_table(const std::vector<LawResult>& laws) {
  std::vector<std::string> scenes;
  for (const LawResult& law : laws) {
    for (const auto& [scene, result] : law.scenes) {
      if (std::find(scenes.begin(), scenes.end(), scene) == scenes.end()) scenes.push_back(scene);
    }
  }
  std::string text = "| forecast |", line = "\n|---|";
  for (const std::string& scene : scenes) {
    text += fmt::format(" {} |", scene);
    line += "---|";
  }
  text += line + "\n";
  for (const LawResult& law : laws) {
    text += fmt::format("| {} |", law.law);
    for (const std::string& scene : scenes) {
      const auto found = std::find_if(law.scenes.begin(), law.scenes.end(),
                                      [&](const auto& s) { return s.first == scene; });
      const bool there = found != law.scenes.end() && found->second.learned;
      text += fmt::format(" {} |", there ? percent(found->second.learned->result.forecast) : "–");
    }
    text += "\n";
  }
  return text;
}

}  // namespace

std::vector<OutsideRow> outside_rows(const std::vector<OutsideCell>& cells) {
  std::vector<OutsideRow> rows;
  for (const LawResult& law : by_law(cells)) rows.push_back(row_of(law));
  return rows;
}

void add_outside_metrics(const std::vector<OutsideCell>& cells, Metrics& metrics) {
  const auto set = [&](const std::string& name, double fit, double forecast, double rung,
                       double explained) {
    metrics.set("forecast." + name, forecast);
    metrics.set("fit." + name, fit);
    metrics.set("rung." + name, rung);
    metrics.set("explained." + name, explained);
  };
  for (const LawResult& law : by_law(cells)) {
    const OutsideRow row = row_of(law);
    set(row.law, row.fit, row.forecast, row.rung, row.explained);
    if (!row.analytic.empty()) metrics.set("best_analytic." + row.law, row.best_analytic);
    for (const auto& [scene, result] : law.scenes) {
      const std::string name = law.law + "." + scene;
      if (result.learned) {
        const Forecast& f = result.learned->result;
        set(name, f.fit, f.forecast, f.rung, f.explained ? 1 : 0);
      }
      if (result.analytic) metrics.set("best_analytic." + name, result.best_analytic());
    }
  }
}

std::string outside_table(const std::vector<OutsideCell>& cells) {
  std::string text =
      "| truth | fit | forecast | worst scene | rung | explained | named | best wrong analytic law "
      "| ratio |\n|---|---|---|---|---|---|---|---|---|\n";
  for (const OutsideRow& r : outside_rows(cells)) {
    const std::string analytic =
        r.analytic.empty() ? "–" : fmt::format("{} ({})", percent(r.best_analytic), r.analytic);
    const double ratio = r.best_analytic / r.forecast;
    text += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", r.law, percent(r.fit),
                        percent(r.forecast), percent(r.worst), rung_name(r.rung),
                        r.explained == 1   ? "yes"
                        : r.explained == 0 ? "no"
                                           : "in part",
                        r.named.empty() ? "–" : r.named, analytic,
                        std::isfinite(ratio) ? fmt::format("{:.3g}", ratio) : "–");
  }
  return text +
         "\nRoot of the mean squared error of positions over the object's largest side: of the "
         "first half of the frames, which was fitted, and of the second half, which was forecast. "
         "Medians over scenes.\n\n" +
         scene_table(by_law(cells));
}

std::string outside_csv(const std::vector<OutsideCell>& cells) {
  std::string csv = "law,scene,fitted,fit,forecast,rung,explained,named,roll_outs,seconds\n";
  for (const OutsideCell& c : cells) {
    csv += fmt::format("{},{},{},{:.6g},{:.6g},{},{},{},{:g},{:.1f}\n", c.law, c.scene, c.fitted,
                       c.result.fit, c.result.forecast, c.result.rung, c.result.explained ? 1 : 0,
                       c.named, c.result.roll_outs, c.seconds);
  }
  return csv;
}

void plot_outside(const std::vector<OutsideCell>& cells, const RunDirectory& out) {
  Chart chart;
  chart.title = "Forecast of the second half by a law fitted to the first half";
  chart.x_label = "true law";
  chart.y_label = "root of position mse / object size, median over scenes";
  chart.log_y = true;
  Series learned, analytic;
  learned.label = "learned";
  analytic.label = "best wrong analytic law";
  learned.points = analytic.points = true;
  for (const OutsideRow& row : outside_rows(cells)) {
    const double x = static_cast<double>(learned.x.size() + 1);
    learned.x.push_back(x);
    learned.y.push_back(row.forecast);
    learned.names.push_back(row.law);
    analytic.x.push_back(x);
    analytic.y.push_back(row.best_analytic);
  }
  chart.series = {learned, analytic};
  out.draw("forecast.png", chart);
}

}  // namespace uniphy
