#include "uniphy/report/plot_labels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "uniphy/report/gnuplot.hpp"

namespace uniphy {
namespace {

// Pixels of a character of the labels' font and of a marker.
constexpr double kCharacter = 6.5, kLine = 13, kMarker = 5;
// Pixels that axes, their marks and labels take.
constexpr double kAxes[2] = {130, 110};

struct Rectangle {
  double x0, y0, x1, y1;
  bool overlaps(const Rectangle& o) const {
    return x0 < o.x1 && o.x0 < x1 && y0 < o.y1 && o.y0 < y1;
  }
};

double scaled(double value, bool log) { return log ? std::log10(value) : value; }

/// Pixels of the points of a chart, by an estimate of gnuplot's axes.
class Area {
 public:
  explicit Area(const Chart& chart) : chart_(chart) {
    for (const Series& series : chart.series) {
      for (std::size_t k = 0; k < series.x.size(); ++k) {
        const double at[] = {scaled(series.x[k], chart.log_x), scaled(series.y[k], chart.log_y)};
        if (!std::isfinite(at[0]) || !std::isfinite(at[1])) continue;
        for (int i = 0; i < 2; ++i) {
          low_[i] = std::min(low_[i], at[i]);
          high_[i] = std::max(high_[i], at[i]);
        }
      }
    }
    // Axes end at a mark.
    const bool log[] = {chart.log_x, chart.log_y};
    for (int i = 0; i < 2; ++i) {
      if (!log[i]) continue;
      low_[i] = std::floor(low_[i]);
      high_[i] = std::ceil(high_[i]);
    }
  }
  double width() const { return chart_.width - kAxes[0]; }
  /// x to the right, y up; nothing where the point cannot be drawn.
  std::optional<std::pair<double, double>> at(double x, double y) const {
    const double p[] = {scaled(x, chart_.log_x), scaled(y, chart_.log_y)};
    if (!std::isfinite(p[0]) || !std::isfinite(p[1])) return {};
    const auto share = [&](int i) {
      return high_[i] > low_[i] ? (p[i] - low_[i]) / (high_[i] - low_[i]) : 0.5;
    };
    return std::pair{share(0) * width(), share(1) * (chart_.height - kAxes[1])};
  }

 private:
  const Chart& chart_;
  double low_[2] = {1e300, 1e300}, high_[2] = {-1e300, -1e300};
};

/// Where a label may stand: from its point, in pixels, and which of its ends is there.
struct Place {
  double right, up;
  const char* end;  ///< "left", "right" or "center"
};
constexpr Place kPlaces[] = {{8, 7, "left"},    {8, -7, "left"},   {-8, 7, "right"},
                             {-8, -7, "right"}, {0, 13, "center"}, {0, -13, "center"}};

Rectangle label_box(double x, double y, double length, const Place& place) {
  const std::string end = place.end;
  const double from = x + place.right - (end == "left" ? 0 : end == "right" ? length : length / 2);
  const double middle = y + place.up;
  return {from, middle - kLine / 2, from + length, middle + kLine / 2};
}

std::string label_command(const Series& series, std::size_t k, const Place& place) {
  // Offsets are in characters of the large font.
  return fmt::format(
      "set label {} at first {}, first {} {} offset {:.2f},{:.2f} noenhanced font ',9'\n",
      gnuplot_text(series.names[k]), series.x[k], series.y[k], place.end, place.right / 8,
      place.up / 16);
}

}  // namespace

std::string label_commands(const Chart& chart) {
  const Area area(chart);
  std::vector<Rectangle> taken;
  for (const Series& series : chart.series) {
    if (!series.points) continue;
    for (std::size_t k = 0; k < series.x.size(); ++k) {
      if (const auto p = area.at(series.x[k], series.y[k])) {
        taken.push_back(
            {p->first - kMarker, p->second - kMarker, p->first + kMarker, p->second + kMarker});
      }
    }
  }
  std::string commands;
  for (const Series& series : chart.series) {
    for (std::size_t k = 0; k < series.names.size(); ++k) {
      const auto p = area.at(series.x[k], series.y[k]);
      if (!p) continue;
      const double length = kCharacter * static_cast<double>(series.names[k].size());
      for (const Place& place : kPlaces) {
        const Rectangle box = label_box(p->first, p->second, length, place);
        const bool free = box.x0 > 0 && box.x1 < area.width() &&
                          std::none_of(taken.begin(), taken.end(),
                                       [&](const Rectangle& t) { return t.overlaps(box); });
        if (!free) continue;
        taken.push_back(box);
        commands += label_command(series, k, place);
        break;
      }
    }
  }
  return commands;
}

}  // namespace uniphy
