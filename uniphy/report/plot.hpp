#pragma once

// Pictures through gnuplot (package gnuplot-nox). Without gnuplot each function prints one warning
// to stderr and returns false: a missing picture never fails a run.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace uniphy {

struct Series {
  std::string label;  ///< empty: not in the legend
  std::vector<double> x;
  std::vector<double> y;           ///< same length as x; points that are not finite leave a gap
  std::vector<double> colour;      ///< empty, or a value a point, shown by the colour scale
  bool points = false;             ///< markers instead of a line
  std::vector<std::string> names;  ///< empty, or a text beside every point, where there is room
};

struct Chart {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::string colour_label;
  bool log_x = false;
  bool log_y = false;
  std::vector<Series> series;
  int width = 900;  ///< pixels
  int height = 600;
};

/// Lines and scatter plots. Throws Error where the series are malformed (x and y of different
/// length) or the file cannot be written.
bool plot_chart(const std::filesystem::path& png, const Chart& chart);

/// A table in colours: what a row comes to in a column.
struct ValueMap {
  std::string title;
  std::vector<std::string> rows, columns;
  std::vector<double> values;      ///< [rows, columns], 0 (bad) … 1 (good); NaN: grey
  std::vector<std::string> texts;  ///< [rows, columns], a few letters inside the field
};

/// Throws Error where the numbers of values or texts do not fit, or the file cannot be written.
bool plot_map(const std::filesystem::path& png, const ValueMap& map);

struct ParticlePanel {
  std::string caption;
  std::vector<double> x;       ///< [particles, 3] m, y upwards
  std::vector<double> colour;  ///< [particles] any value; empty: by distance to the camera
};

/// Panels on a grid of `columns`, read row by row, each with its caption under it, all seen by the
/// same orthographic camera and coloured by the same scale; what is far is darker.
struct ParticlePicture {
  std::string title;
  std::vector<ParticlePanel> panels;
  std::string colour_label;  ///< of the colour bar; empty: there is none
  int columns = 0;           ///< 0: one row
  double azimuth = 35;       ///< degrees, camera turned about the y axis
  double elevation = 20;     ///< degrees above the horizon
  int panel_pixels = 260;
  double low = 0;  ///< the cube that is drawn, [low, high]^3 m
  double high = 1;
};

/// A colour that follows the particles: the height of each [particles, 3] from 0 of the lowest to 1
/// of the highest, NaN of what is not there.
std::vector<double> heights_in_body(const std::vector<double>& x);
inline constexpr const char* kHeightInBody = "height within the body in the first frame";

bool plot_particles(const std::filesystem::path& png, const ParticlePicture& picture);

/// The picture coordinates of a point: x right, y up, z towards the camera.
struct Projected {
  double x, y, z;
};
Projected project_point(const ParticlePicture& picture, const double* point);

/// Whether a gnuplot that runs is on the PATH (asked once).
bool gnuplot_available();

}  // namespace uniphy
