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
/// frame: transport costs their product. A rough comparison, a fifteenth of that, tells which start
/// is ahead.
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

}  // namespace uniphy
