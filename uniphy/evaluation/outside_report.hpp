#pragma once

#include <string>
#include <vector>

#include "uniphy/evaluation/forecast.hpp"
#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// One fit: of the motion of `law` in `scene`, by `fitted` ("learned" or the name of a family).
struct OutsideCell {
  std::string law, scene, fitted;
  Forecast result;
  std::string named;   ///< learned: what it behaves like; empty where it is not determined
  double seconds = 0;  ///< of the run that made it
};

/// Name of the law that is judged, among OutsideCell::fitted.
inline constexpr const char* kLearnedLaw = "learned";

/// All scenes of one true law.
struct OutsideRow {
  std::string law;
  double fit = 0, forecast = 0, worst = 0;  ///< medians over scenes, and the worst forecast
  double rung = 0, explained = 0;           ///< medians
  double best_analytic = 0;  ///< median of the best forecast of a wrong family, or NaN
  std::string analytic;      ///< that family, in the most scenes
  std::string named;         ///< what it behaves like, in the most scenes
};

/// The rows in the order of the cells.
std::vector<OutsideRow> outside_rows(const std::vector<OutsideCell>& cells);

/// forecast.LAW, fit.LAW, rung.LAW, explained.LAW, best_analytic.LAW (medians over scenes) and the
/// same of every scene, forecast.LAW.SCENE and so on. What failed is infinite.
void add_outside_metrics(const std::vector<OutsideCell>& cells, Metrics& metrics);

/// outside.md, outside.csv, forecast.png.
std::string outside_table(const std::vector<OutsideCell>& cells);
std::string outside_csv(const std::vector<OutsideCell>& cells);
void plot_outside(const std::vector<OutsideCell>& cells, const RunDirectory& out);

}  // namespace uniphy
