#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/io/trajectory.hpp"

namespace uniphy {

/// How far one trajectory is from another of the same particles.
struct TrajectoryComparison {
  double position_mse = 0;  ///< m², mean over frames, particles and coordinates of (x̂ − x)²
  double size = 0;          ///< m, largest side of the reference's bounding box in its first frame
  double root_over_size = 0;      ///< √position_mse / size
  double largest_distance = 0;    ///< m, of a particle from its reference, over all frames
  double final_mse = 0;           ///< m², of the last frame
  std::vector<double> time;       ///< s, of the compared frames
  std::vector<double> frame_mse;  ///< m², of each compared frame
  std::vector<double> body_mse;   ///< m², position_mse of each body of the reference
};

/// Which frames are compared.
enum class FrameMatch {
  all,    ///< the trajectories must have the same times and be complete
  common  ///< the times that both have
};

/// position_mse is what the papers of this field report: the mean over the stored frames, the first
/// one included. Throws Error, naming the two as `predicted_name` and `reference_name`, where the
/// numbers of particles differ, or the times do not match (to 1e-6 of the time between frames).
TrajectoryComparison compare_trajectories(const Trajectory& predicted, const Trajectory& reference,
                                          FrameMatch match,
                                          const std::string& predicted_name = "trajectory",
                                          const std::string& reference_name = "reference");

}  // namespace uniphy
