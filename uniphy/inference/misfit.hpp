#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "uniphy/io/observation.hpp"
#include "uniphy/io/trajectory.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy {

/// How far a roll-out of a fitted law is from the observed positions, when and where.
struct Misfit {
  std::vector<double> time;     ///< [frames] s
  std::vector<double> root;     ///< [frames] root of the mean square of a coordinate, over size
  std::vector<double> largest;  ///< [frames] of one particle, likewise
  double over_size = 0;         ///< over all frames
  double allowed = 0;           ///< what noise and tolerance account for, over size

  /// The first frame from which the root stays above `allowed`; the number of frames where it ends
  /// below.
  std::int64_t grows = 0;
  std::int64_t particle = 0;  ///< of the largest error over all frames
  /// The third of the body along each axis, of its box at the first frame, that has the largest
  /// error: 0 low, 1 middle, 2 high; and that error, over size.
  std::array<int, 3> block{};
  double block_root = 0;
};

/// Errors of `fitted` at the observed frames; tolerance over size. The noise counts twice: the
/// positions that a roll-out starts from have it as well.
Misfit misfit_of(const Observation& seen, const Trajectory& fitted, double tolerance);

/// When and where it sits, in words.
std::string misfit_place(const Misfit& misfit, const Observation& seen);

/// time_s, root_over_size, largest_over_size, a row a frame.
void write_misfit(const std::filesystem::path& csv, const Misfit& misfit);
Chart misfit_chart(const Misfit& misfit);

}  // namespace uniphy
