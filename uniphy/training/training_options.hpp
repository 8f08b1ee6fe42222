#pragma once

#include <cstdint>
#include <string>

#include "models/learned_law.hpp"
#include "uniphy/config/config.hpp"
#include "uniphy/training/loss_options.hpp"

namespace uniphy {

/// What Algorithm 1 works with.
struct TrainingOptions {
  models::LearnedLawOptions law;
  std::uint64_t seed = 1;
  std::int64_t steps = 20000;
  std::int64_t batch_per_trajectory = 64;  ///< every step sees all trajectories
  double learning_rate = 3e-3;             ///< of the networks; falls to zero along a cosine
  double latent_rate = 10;                 ///< times learning_rate, for z
  double weight_decay = 1e-6;
  double clip = 1;          ///< largest norm of the networks' gradient
  bool clip_each = false;   ///< of each of the two networks, not of both together
  double caps_share = 0.7;  ///< part of the steps that judge the caps alone, see ReturnStage
  LossOptions loss;
  std::int64_t checkpoint_every = 500;

  /// Everything that the result depends on, as text.
  std::string text() const;
};

/// Declares and reads the sections `model` and `training`; the defaults of their keys are what
/// `defaults` holds. Without `with_steps` the number of steps is not a key.
TrainingOptions read_training_options(Section& config, const TrainingOptions& defaults,
                                      bool with_steps);

}  // namespace uniphy
