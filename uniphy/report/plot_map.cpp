#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "uniphy/report/gnuplot.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy {
namespace {

constexpr int kCellWidth = 118, kCellHeight = 30;  // pixels: a text of 14 letters in one line
constexpr int kLetter = 8;                         // pixels, a letter of the labels of the rows

/// From Okabe and Ito's vermilion (0) through white to their blue (1), told apart with any colour
/// vision and lightest in the middle.
unsigned colour_of(double value) {
  const double t = std::clamp(value, 0.0, 1.0);
  constexpr double kLow[3] = {0xD5, 0x5E, 0x00}, kMiddle[3] = {0xF7, 0xF7, 0xF0},
                   kHigh[3] = {0x56, 0xA8, 0xD8};
  unsigned colour = 0;
  for (int c = 0; c < 3; ++c) {
    const double mixed = t < 0.5 ? kLow[c] + 2 * t * (kMiddle[c] - kLow[c])
                                 : kMiddle[c] + (2 * t - 1) * (kHigh[c] - kMiddle[c]);
    colour = colour << 8 | static_cast<unsigned>(std::lround(mixed));
  }
  return colour;
}

}  // namespace

bool plot_map(const std::filesystem::path& png, const ValueMap& map) {
  const std::size_t rows = map.rows.size(), columns = map.columns.size();
  if (map.values.size() != rows * columns || map.texts.size() != rows * columns) {
    throw Error(fmt::format(
        "{}: expected {} values and texts ({} rows, {} columns), found {} and {}", png.string(),
        rows * columns, rows, columns, map.values.size(), map.texts.size()));
  }
  if (rows == 0 || columns == 0) {
    std::fprintf(stderr, "warning: %s: not drawn, there is nothing in it\n", png.c_str());
    return false;
  }
  std::size_t longest = 0;
  for (const std::string& row : map.rows) longest = std::max(longest, row.size());
  const int left = kLetter * static_cast<int>(longest) + 20, top = 80, right = 20, bottom = 20;
  const int width = left + kCellWidth * static_cast<int>(columns) + right,
            height = top + kCellHeight * static_cast<int>(rows) + bottom;

  std::string script = fmt::format(
      "set label {} at screen 0.5,screen {} center noenhanced\nunset key\nunset border\nset "
      "lmargin at screen {}\n"
      "set rmargin at screen {}\nset tmargin at screen {}\nset bmargin at screen {}\n"
      "set xrange [0:{}]\nset yrange [{}:0]\nunset ytics\nunset xtics\n",
      gnuplot_text(map.title), 1 - 22.0 / height, double(left) / width, 1 - double(right) / width,
      1 - double(top) / height, double(bottom) / height, columns, rows);
  for (std::size_t c = 0; c < columns; ++c) {
    script += fmt::format("set label {} at {},-0.4 center noenhanced\n",
                          gnuplot_text(map.columns[c]), c + 0.5);
  }
  for (std::size_t r = 0; r < rows; ++r) {
    script += fmt::format("set label {} at -0.08,{} right noenhanced\n", gnuplot_text(map.rows[r]),
                          r + 0.5);
    for (std::size_t c = 0; c < columns; ++c) {
      const double value = map.values[r * columns + c];
      const unsigned colour = std::isfinite(value) ? colour_of(value) : 0xEEEEEE;
      script += fmt::format(
          "set object rect from {},{} to {},{} fc rgb '#{:06x}' fs solid border lc rgb 'white' "
          "behind\n",
          c, r, c + 1, r + 1, colour);
      if (!map.texts[r * columns + c].empty()) {
        script += fmt::format("set label {} at {},{} center noenhanced\n",
                              gnuplot_text(map.texts[r * columns + c]), c + 0.5, r + 0.5);
      }
    }
  }
  return run_gnuplot(png, width, height, script + "plot NaN notitle\n");
}

}  // namespace uniphy
