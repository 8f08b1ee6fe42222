#pragma once

#include <torch/types.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "uniphy/io/observation.hpp"

namespace uniphy::ops {
class CloudTargets;
}

namespace uniphy {

/// How many points of either side are compared at most, drawn at random, of a cloud anew in every
/// frame: transport costs their product. Of 1000 and 1000 points a frame takes 20 ms, of 256 and
/// 256 about 1.2 ms; twice the error is what that costs, where every frame has other points.
enum class CloudDetail { all, rough };
inline constexpr std::int64_t kMostCloudPoints = 1000, kRoughCloudPoints = 256;

/// The particles of a body against the clouds of an observation (ops::CloudTargets), by
/// Observation::cloud_distance. Immutable; calls may run at the same time.
class CloudComparison {
 public:
  CloudComparison(const Observation& observation, CloudDetail detail);

  /// x [frames, particles, 3] m, float64, at the first frames → [frames, columns()] m: residuals
  /// whose mean square over the columns is that distance for one coordinate, so that of transport
  /// they are how far each particle is from its place. Gradients go through it.
  torch::Tensor residuals(const torch::Tensor& x) const;
  std::int64_t columns() const { return columns_; }
  /// Columns of a frame on average: frames without a point have none.
  double seen_per_frame() const { return seen_per_frame_; }

 private:
  torch::Tensor particles_;  ///< rows of those that are compared; undefined: all
  std::shared_ptr<const ops::CloudTargets> targets_;
  std::int64_t columns_ = 0;
  double seen_per_frame_ = 0;
};

/// What the body as it stands misses of the first cloud, m, root of the mean square of a
/// coordinate: the noise, and that a cloud is a sample. Half the spacing of the particles where the
/// first frame shows nothing.
double cloud_noise(const Observation& observation);

/// The frames with those numbers.
Observation some_frames(const Observation& observation, const std::vector<std::int64_t>& frames);

}  // namespace uniphy
