#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "uniphy/report/gnuplot.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/report/plot_labels.hpp"

namespace uniphy {
namespace {

// Okabe and Ito's colours, told apart with any colour vision; yellow is left out on white paper.
constexpr const char* kColours[] = {"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                    "#E69F00", "#56B4E9", "#000000"};

bool drawable(double value, bool log) { return std::isfinite(value) && (!log || value > 0); }

}  // namespace

bool plot_chart(const std::filesystem::path& png, const Chart& chart) {
  std::string data;
  std::string plot;
  bool coloured = false, scattered = false;
  std::size_t colour_index = 0;
  for (std::size_t i = 0; i < chart.series.size(); ++i) {
    const Series& series = chart.series[i];
    if (series.x.size() != series.y.size() ||
        (!series.colour.empty() && series.colour.size() != series.x.size())) {
      throw Error(fmt::format(
          "{}: series \"{}\": expected as many y (and colours) as x ({}), "
          "found {} (and {})",
          png.string(), series.label, series.x.size(), series.y.size(), series.colour.size()));
    }
    if (!series.names.empty() && series.names.size() != series.x.size()) {
      throw Error(fmt::format("{}: series \"{}\": expected as many names as x ({}), found {}",
                              png.string(), series.label, series.x.size(), series.names.size()));
    }
    std::string block;
    bool any = false;
    for (std::size_t k = 0; k < series.x.size(); ++k) {
      const bool good = drawable(series.x[k], chart.log_x) && drawable(series.y[k], chart.log_y) &&
                        (series.colour.empty() || std::isfinite(series.colour[k]));
      any = any || good;
      // An empty line ends one stroke and begins the next.
      block += good ? fmt::format("{} {} {}\n", series.x[k], series.y[k],
                                  series.colour.empty() ? 0.0 : series.colour[k])
                    : "\n";
    }
    if (!any) continue;
    scattered = scattered || (series.points && !series.label.empty());
    data += fmt::format("$s{} << EOD\n{}EOD\n", i, block);
    const std::string title = series.label.empty()
                                  ? "notitle"
                                  : fmt::format("title {} noenhanced", gnuplot_text(series.label));
    std::string style;
    if (!series.colour.empty()) {
      coloured = true;
      style = "using 1:2:3 with points pt 7 ps 0.9 lc palette";
    } else {
      const char* colour = kColours[colour_index % std::size(kColours)];
      // Where the colours begin anew, circles are open and lines dashed.
      const bool again = colour_index++ >= std::size(kColours);
      style = fmt::format("using 1:2 with {}{} lc rgb '{}'",
                          series.points ? "points ps 0.9 pt " : "lines lw 2 dt ",
                          series.points ? (again ? 6 : 7) : (again ? 2 : 1), colour);
    }
    plot += fmt::format("{} $s{} {} {}", plot.empty() ? "plot" : ", \\\n    ", i, style, title);
  }
  if (plot.empty()) {
    std::fprintf(stderr, "warning: %s: not drawn, no point can be drawn\n", png.c_str());
    return false;
  }

  std::string script;
  if (!chart.title.empty()) {
    script += fmt::format("set title {} noenhanced\n", gnuplot_text(chart.title));
  }
  script += fmt::format("set xlabel {} noenhanced\nset ylabel {} noenhanced\n",
                        gnuplot_text(chart.x_label), gnuplot_text(chart.y_label));
  script +=
      "set border 3 lc rgb '#444444'\nset tics nomirror\n"
      "set grid lc rgb '#dddddd' lt 1 lw 0.5\n";
  // Points may lie anywhere; a line that passes under the legend shows on both sides of it.
  // Without room on the right the last label of the axis is cut.
  script += scattered ? "set key outside right top\n" : "set key opaque\nset rmargin 6\n";
  script += label_commands(chart);
  if (chart.log_x) script += "set logscale x\nset format x '10^{%T}'\n";
  if (chart.log_y) script += "set logscale y\nset format y '10^{%T}'\n";
  if (coloured) {
    script += "set palette defined (";
    for (int k = 0; k < 10; ++k) {
      script += fmt::format("{}{} '#{:06x}'", k ? ", " : "", k, viridis(k / 9.0));
    }
    script += fmt::format(")\nset cblabel {} noenhanced\n", gnuplot_text(chart.colour_label));
  }
  return run_gnuplot(png, chart.width, chart.height, data + script + plot + "\n");
}

}  // namespace uniphy
