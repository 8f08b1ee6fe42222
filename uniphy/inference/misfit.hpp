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
  std::vector<double> root;     ///< [frames] root of the mean square of a coordinate, over size;
                                ///< 0 where a frame shows nothing
  std::vector<double> largest;  ///< [frames] of one point, likewise
  double over_size = 0;         ///< over all frames
  double allowed = 0;           ///< what noise and tolerance account for, over size
  /// The same of a forecast, whose tolerance is kForecastAllowance times as large.
  double allowed_ahead = 0;

  /// The first frame from which the root stays above `allowed`; the number of frames where it ends
  /// below.
  std::int64_t grows = 0;
  std::int64_t particle = 0;  ///< the point of the largest error over all frames
  /// The third of the body along each axis, of its box at the first frame, that has the largest
  /// error: 0 low, 1 middle, 2 high; and that error, over size.
  std::array<int, 3> block{};
  double block_root = 0;
};

/// Errors of `fitted` at the observed frames; tolerance over size. The noise counts
/// kNoiseAllowance times where starts were fitted, else twice: the positions that a roll-out starts
/// from have it as well.
Misfit misfit_of(const Observation& seen, const Trajectory& fitted, double tolerance,
                 bool starts_fitted);
/// The same of clouds and a roll-out of the particles, by CloudComparison; where on the body is not
/// told.
Misfit misfit_of_clouds(const Observation& seen, const Trajectory& fitted, double tolerance);

/// What a right law may miss in a forecast, over what it may in a fit: of the families and of laws
/// from outside that the numbers hold, forecasts of the benchmark cube are off by two to four times
/// the fit.
inline constexpr double kForecastAllowance = 5;
/// The root of the mean square of a thousand coordinates scatters by 2 %; an estimate of the noise
/// from third differences is as good.
inline constexpr double kNoiseAllowance = 1.1;

/// When and where it sits, in words.
std::string misfit_place(const Misfit& misfit, const Observation& seen);

/// time_s, root_over_size, largest_over_size, a row a frame.
void write_misfit(const std::filesystem::path& csv, const Misfit& misfit);
Chart misfit_chart(const Misfit& misfit);

}  // namespace uniphy
