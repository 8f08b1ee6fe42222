#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "ops/kernels/base/error.hpp"
#include "uniphy/report/gnuplot.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kCaptionPixels = 24;
constexpr int kBarPixels = 40;  // of the colour bar with its numbers
constexpr int kTitlePixels = 34;
// Diameter in pixels of gnuplot's point type 7 at size 1, both terminals.
constexpr double kPointPixels = 6;

/// The corner of the cube with bits k of `index` set to high.
Projected corner(const ParticlePicture& picture, int index) {
  double point[3];
  for (int k = 0; k < 3; ++k) point[k] = index >> k & 1 ? picture.high : picture.low;
  return project_point(picture, point);
}

struct Bounds {
  double low_x, high_x, low_y, high_y, low_z, high_z;
};

Bounds cube_bounds(const ParticlePicture& picture) {
  Bounds b{1e300, -1e300, 1e300, -1e300, 1e300, -1e300};
  for (int i = 0; i < 8; ++i) {
    const Projected p = corner(picture, i);
    b.low_x = std::min(b.low_x, p.x);
    b.high_x = std::max(b.high_x, p.x);
    b.low_y = std::min(b.low_y, p.y);
    b.high_y = std::max(b.high_y, p.y);
    b.low_z = std::min(b.low_z, p.z);
    b.high_z = std::max(b.high_z, p.z);
  }
  return b;
}

unsigned shaded(unsigned colour, double light) {
  unsigned out = 0;
  for (int shift = 16; shift >= 0; shift -= 8) {
    const double channel = static_cast<double>(colour >> shift & 0xFFu) * light;
    out |= static_cast<unsigned>(std::clamp(channel, 0.0, 255.0)) << shift;
  }
  return out;
}

/// Mean distance of neighbours, from the volume that the particles fill.
double spacing(const std::vector<double>& x) {
  double volume = 1;
  for (std::size_t k = 0; k < 3; ++k) {
    double low = 1e300, high = -1e300;
    for (std::size_t i = k; i < x.size(); i += 3) {
      low = std::min(low, x[i]);
      high = std::max(high, x[i]);
    }
    volume *= std::max(high - low, 1e-3);
  }
  return std::cbrt(volume / std::max<double>(1, static_cast<double>(x.size()) / 3));
}

/// The least and the largest colour of all panels, which have one scale.
std::pair<double, double> colour_range(const ParticlePicture& picture) {
  double low = 1e300, high = -1e300;
  for (const ParticlePanel& panel : picture.panels) {
    for (const double value : panel.colour) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  return {low, high};
}

/// Lines "x y size colour" of a panel, far particles first; each is a dark disc under a bright one.
std::string particle_lines(const ParticlePicture& picture, const ParticlePanel& panel,
                           const Bounds& bounds, std::pair<double, double> range, double shift_x,
                           double shift_y, double scale) {
  const std::size_t count = panel.x.size() / 3;
  std::vector<Projected> points;
  for (std::size_t i = 0; i < count; ++i) {
    points.push_back(project_point(picture, panel.x.data() + 3 * i));
  }
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return points[a].z < points[b].z; });
  const auto [low, high] = range;
  const double pixels = std::clamp(1.25 * spacing(panel.x) * scale, 2.0, 16.0);
  std::string lines;
  for (const std::size_t i : order) {
    const Projected& p = points[i];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) continue;
    const double depth =
        std::clamp((p.z - bounds.low_z) / (bounds.high_z - bounds.low_z), 0.0, 1.0);
    const double value =
        panel.colour.empty() ? depth : (high > low ? (panel.colour[i] - low) / (high - low) : 0.5);
    const unsigned bright = shaded(viridis(value), 0.5 + 0.5 * depth);
    const double x = p.x + shift_x, y = p.y + shift_y;
    lines +=
        fmt::format("{:.5f} {:.5f} {:.3f} {}\n", x, y, pixels / kPointPixels, shaded(bright, 0.45));
    lines += fmt::format("{:.5f} {:.5f} {:.3f} {}\n", x, y, 0.75 * pixels / kPointPixels, bright);
  }
  return lines;
}

std::string cube_lines(const ParticlePicture& picture, double shift_x, double shift_y) {
  std::string lines;
  for (int a = 0; a < 8; ++a) {
    for (int axis = 0; axis < 3; ++axis) {
      if (a >> axis & 1) continue;
      const Projected p = corner(picture, a);
      const Projected q = corner(picture, a | 1 << axis);
      lines += fmt::format("{:.5f} {:.5f}\n{:.5f} {:.5f}\n\n", p.x + shift_x, p.y + shift_y,
                           q.x + shift_x, q.y + shift_y);
    }
  }
  return lines;
}

std::string floor_polygon(const ParticlePicture& picture, double shift_x, double shift_y) {
  std::string text = "set object polygon from ";
  const int loop[] = {0, 1, 5, 4, 0};  // the four corners with y low
  for (int i = 0; i < 5; ++i) {
    const Projected p = corner(picture, loop[i]);
    text += fmt::format("{}{:.5f},{:.5f}", i ? " to " : "", p.x + shift_x, p.y + shift_y);
  }
  return text + " fillstyle solid noborder fillcolor rgb '#f0f0f0' behind\n";
}

/// A bar of colours with the numbers at its ends, around (x, y), `width` m wide.
std::string colour_bar(const ParticlePicture& picture, double x, double y, double width,
                       double scale) {
  constexpr int kSteps = 64;
  const double half = 5 / scale;
  std::string script;
  for (int k = 0; k < kSteps; ++k) {
    const double from = x + width * (double(k) / kSteps - 0.5);
    script += fmt::format(
        "set object rectangle from {:.5f},{:.5f} to {:.5f},{:.5f} fillstyle solid noborder "
        "fillcolor rgb '#{:06x}' front\n",
        from, y - half, std::min(from + 2 * width / kSteps, x + 0.5 * width), y + half,
        viridis((k + 0.5) / kSteps));
  }
  const auto [low, high] = colour_range(picture);
  const double gap = 0.5 * width + 6 / scale;
  script +=
      fmt::format("set label {} at {:.5f},{:.5f} right noenhanced\n",
                  gnuplot_text(fmt::format("{}  {:.3g}", picture.colour_label, low)), x - gap, y);
  return script +
         fmt::format("set label \"{:.3g}\" at {:.5f},{:.5f} left noenhanced\n", high, x + gap, y);
}

}  // namespace

Projected project_point(const ParticlePicture& picture, const double* point) {
  const double a = picture.azimuth * kPi / 180;
  const double e = picture.elevation * kPi / 180;
  const double middle = 0.5 * (picture.low + picture.high);
  const double x = point[0] - middle, y = point[1] - middle, z = point[2] - middle;
  const double towards = std::sin(a) * x + std::cos(a) * z;  // horizontal, towards the camera
  return {std::cos(a) * x - std::sin(a) * z, std::cos(e) * y - std::sin(e) * towards,
          std::sin(e) * y + std::cos(e) * towards};
}

std::vector<double> heights_in_body(const std::vector<double>& x) {
  double low = 1e300, high = -1e300;
  for (std::size_t i = 1; i < x.size(); i += 3) {
    if (!std::isfinite(x[i])) continue;
    low = std::min(low, x[i]);
    high = std::max(high, x[i]);
  }
  std::vector<double> heights;
  for (std::size_t i = 1; i < x.size(); i += 3) {
    heights.push_back(high > low || !std::isfinite(x[i]) ? (x[i] - low) / (high - low) : 0.5);
  }
  return heights;
}

bool plot_particles(const std::filesystem::path& png, const ParticlePicture& picture) {
  const int count = static_cast<int>(picture.panels.size());
  if (count == 0) throw Error(fmt::format("{}: expected at least one panel", png.string()));
  for (const ParticlePanel& panel : picture.panels) {
    if (panel.x.size() % 3 != 0 ||
        (!panel.colour.empty() && panel.colour.size() != panel.x.size() / 3)) {
      throw Error(
          fmt::format("{}: panel \"{}\": expected [particles, 3] positions and one colour a "
                      "particle, found {} and {} numbers",
                      png.string(), panel.caption, panel.x.size(), panel.colour.size()));
    }
  }
  const int columns = picture.columns > 0 ? std::min(picture.columns, count) : count;
  const int rows = (count + columns - 1) / columns;
  const Bounds bounds = cube_bounds(picture);
  const double width = bounds.high_x - bounds.low_x;
  const double height = bounds.high_y - bounds.low_y;
  const double scale = picture.panel_pixels / (1.06 * width);  // pixels a metre
  const double step_x = 1.06 * width;
  const double step_y = 1.06 * height + kCaptionPixels / scale;

  std::string script = "unset border\nunset tics\nunset key\nset size ratio -1\n";
  std::string cubes, points;
  const auto range = colour_range(picture);
  for (int i = 0; i < count; ++i) {
    const double shift_x = (i % columns) * step_x;
    const double shift_y = -(i / columns) * step_y;
    const ParticlePanel& panel = picture.panels[static_cast<std::size_t>(i)];
    script += floor_polygon(picture, shift_x, shift_y);
    script +=
        fmt::format("set label {} at {:.5f},{:.5f} center noenhanced\n",
                    gnuplot_text(panel.caption), shift_x + 0.5 * (bounds.low_x + bounds.high_x),
                    shift_y + bounds.low_y - 0.03 * height - 0.5 * kCaptionPixels / scale);
    cubes += cube_lines(picture, shift_x, shift_y);
    points += particle_lines(picture, panel, bounds, range, shift_x, shift_y, scale);
  }
  const int title_pixels = picture.title.empty() ? 0 : kTitlePixels;
  const int bar_pixels =
      picture.colour_label.empty() || range.first > range.second ? 0 : kBarPixels;
  const int pixel_width = static_cast<int>(std::lround(columns * step_x * scale));
  const int pixel_height =
      static_cast<int>(std::lround(rows * step_y * scale)) + title_pixels + bar_pixels;
  if (!picture.title.empty()) {
    script += fmt::format(
        "set label {} at screen 0.5, screen {:.5f} center noenhanced font ',14'\n",
        gnuplot_text(picture.title), 1 - 0.5 * title_pixels / static_cast<double>(pixel_height));
  }
  const double low_x = bounds.low_x - 0.03 * width;
  const double end_y = bounds.low_y - 0.03 * height - kCaptionPixels / scale - (rows - 1) * step_y;
  const double low_y = end_y - bar_pixels / scale;
  if (bar_pixels > 0) {
    const double x = low_x + 0.5 * columns * step_x;
    // At the right of the label where the picture is narrow.
    script += colour_bar(picture, x + std::min(0.2 * width, 0.2 * columns * step_x),
                         0.5 * (low_y + end_y), 0.7 * width, scale);
  }
  script += fmt::format(
      "set lmargin at screen 0\nset rmargin at screen 1\nset bmargin at screen 0\n"
      "set tmargin at screen {:.6f}\nset xrange [{:.6f}:{:.6f}]\nset yrange [{:.6f}:{:.6f}]\n",
      1 - title_pixels / static_cast<double>(pixel_height), low_x, low_x + columns * step_x, low_y,
      low_y + rows * step_y + bar_pixels / scale);
  std::string plot = "plot $cubes using 1:2 with lines lw 1 lc rgb '#bbbbbb'";
  if (!points.empty()) {
    plot += ", $points using 1:2:3:4 with points pt 7 ps variable lc rgb variable";
  }
  const std::string data = fmt::format("$cubes << EOD\n{}EOD\n", cubes) +
                           (points.empty() ? "" : fmt::format("$points << EOD\n{}EOD\n", points));
  return run_gnuplot(png, pixel_width, pixel_height, data + script + plot + "\n");
}

}  // namespace uniphy
