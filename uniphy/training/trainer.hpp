#pragma once

#include <torch/torch.h>

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "uniphy/io/model_file.hpp"
#include "uniphy/training/networks.hpp"
#include "uniphy/training/objective.hpp"

namespace uniphy {

/// Algorithm 1: φ, θ and one z per trajectory, all at once, on samples of simulated trajectories.
struct TrainingOptions {
  NetworkOptions network;
  std::uint64_t seed = 1;
  std::int64_t steps = 20000;
  std::int64_t batch_per_trajectory = 64;  ///< every step sees all trajectories
  double learning_rate = 3e-3;             ///< of the networks; falls to zero along a cosine
  double latent_rate = 10;                 ///< times learning_rate, for z
  double weight_decay = 1e-6;
  double latent_sigma = 10;  ///< σ of the prior ‖z‖²/σ²
  double error_floor = 0.1;  ///< see LawErrors
  double delta = 1e-3;       ///< δ of log(1 + error/δ), see LawErrors
  double clip = 1;           ///< largest norm of the networks' gradient
  std::int64_t checkpoint_every = 500;
};

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
  Networks networks;
  torch::Tensor z;  ///< [N, latent_size]
  std::vector<TrainingPoint> history;
  double seconds = 0;  ///< of training, those before an interruption included
};

/// Trains, saving `checkpoint` every checkpoint_every steps and at an interrupt; where that file is
/// there already, it goes on from it, to the same bits as an uninterrupted run. Throws Error where
/// the checkpoint belongs to other options or other data, Interrupted after saving. With `heldout`
/// the history has held-out curves; networks and codes are the same bits with and without.
TrainingResult train(const Dataset& data, const TrainingOptions& options,
                     const std::filesystem::path& checkpoint, const Dataset* heldout = nullptr);

/// The auto-decoder's own inference: z alone, fitted to the samples of each trajectory of `data`.
struct LatentFitOptions {
  std::int64_t starts = 4;  ///< the training codes that answer best, each refined
  std::int64_t steps = 800;
  std::int64_t batch_per_trajectory = 128;
  double learning_rate = 3e-2;
  double latent_sigma = 10;
  double error_floor = 0.1;
  double delta = 1e-3;
  std::uint64_t seed = 1;
};
/// [N, latent_size]
torch::Tensor fit_latents(const Dataset& data, const Networks& networks,
                          const torch::Tensor& training_z, const LatentFitOptions& options);

/// The model file of a trained law with the codes of its trajectories.
ModelFile model_file(const Networks& networks, const torch::Tensor& z, const Dataset& data,
                     const std::string& config);

}  // namespace uniphy
