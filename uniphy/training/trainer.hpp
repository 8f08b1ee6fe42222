#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "models/trained_model.hpp"
#include "uniphy/training/law_columns.hpp"
#include "uniphy/training/training_options.hpp"

namespace uniphy {

/// A point of the training curves: medians over trajectories of the root of the mean error.
struct TrainingPoint {
  std::int64_t step = 0;
  double loss = 0;
  double stress_error = 0;
  double projection_error = 0;
  /// The same over the held-out set (heldout_curve.hpp), NaN without one.
  double heldout_stress_error = std::numeric_limits<double>::quiet_NaN();
  double heldout_projection_error = std::numeric_limits<double>::quiet_NaN();
};

struct TrainingResult {
  models::TrainedModel model;
  std::vector<TrainingPoint> history;
  double seconds = 0;  ///< of training, those before an interruption included
};

/// Algorithm 1: φ, θ and one z per trajectory, all at once, on samples of simulated trajectories.
/// Saves `checkpoint` every checkpoint_every steps and at an interrupt; where that file is there
/// already, it resumes from it, to the same bits as an uninterrupted run. Throws Error where the
/// checkpoint belongs to other options or other data, Interrupted after saving. With `heldout`, the
/// columns of another data set in the form of the law, the history has held-out curves; networks
/// and codes are the same bits with and without.
TrainingResult train(const Dataset& data, const TrainingOptions& options,
                     const std::filesystem::path& checkpoint, const LawColumns* heldout = nullptr);

}  // namespace uniphy
