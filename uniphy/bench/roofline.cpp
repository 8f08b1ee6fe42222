#include "uniphy/bench/roofline.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace uniphy::bench {

Chart roofline(const BenchReport& report) {
  const Machine& m = report.machine;
  Chart chart;
  chart.title = fmt::format("Roofline of one core ({}, float32)", m.isa);
  chart.x_label = "arithmetic intensity, flop/byte of what must be read and written";
  chart.y_label = "Gflop/s";
  chart.log_x = chart.log_y = true;
  chart.width = 1100;
  chart.height = 700;
  const double ridge = m.fma_core / m.copy_core;
  const auto roof = [&chart](std::string label, std::vector<double> x, std::vector<double> y) {
    chart.series.emplace_back();
    chart.series.back().label = std::move(label);
    chart.series.back().x = std::move(x);
    chart.series.back().y = std::move(y);
  };
  roof(fmt::format("copy bandwidth, {:.0f} GB/s", m.copy_core), {0.5, ridge},
       {0.5 * m.copy_core, m.fma_core});
  roof(fmt::format("multiply-adds, {:.0f} Gflop/s", m.fma_core),
       {ridge, std::max(4 * ridge, 4000.0)}, {m.fma_core, m.fma_core});
  // One series for each kind of work, its passes and sizes as points.
  for (const BenchRow& row : report.rows) {
    if (!std::isfinite(row.flops) || !std::isfinite(row.bytes) || row.work == "svd3 f64") continue;
    if (row.pass == "both") continue;  // its passes are there
    const std::string label = row.work + ", " + row.pass;
    auto at = std::find_if(chart.series.begin(), chart.series.end(),
                           [&](const Series& s) { return s.label == label; });
    if (at == chart.series.end()) {
      chart.series.emplace_back();
      at = chart.series.end() - 1;
      at->label = label;
      at->points = true;
    }
    at->x.push_back(row.flops / row.bytes);
    at->y.push_back(row.flops / row.one / 1e9);
  }
  return chart;
}

}  // namespace uniphy::bench
