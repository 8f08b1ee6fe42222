#pragma once

// Private to the plot_*.cpp files.

#include <filesystem>
#include <string>

namespace uniphy {

/// Runs a script that ends in `plot ...`. Terminal, size and output are set in front of it. Returns
/// false with a warning on stderr where gnuplot is missing or refuses; throws Error where the
/// directory cannot be written.
bool run_gnuplot(const std::filesystem::path& png, int width, int height,
                 const std::string& script);

/// A gnuplot string literal.
std::string gnuplot_text(const std::string& text);

/// A point of the viridis scale, value in [0, 1], as 0xRRGGBB.
unsigned viridis(double value);

}  // namespace uniphy
