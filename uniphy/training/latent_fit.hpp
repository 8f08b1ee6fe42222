#pragma once

#include <cstdint>

#include "models/trained_model.hpp"
#include "ops/base/torch.hpp"
#include "uniphy/training/law_columns.hpp"
#include "uniphy/training/loss_options.hpp"

namespace uniphy {

/// The auto-decoder's own inference: z alone, fitted to the samples of each trajectory.
struct LatentFitOptions {
  std::int64_t starts = 4;  ///< the training codes that answer best, each refined
  std::int64_t steps = 800;
  std::int64_t batch_per_trajectory = 128;
  double learning_rate = 3e-2;
  LossOptions loss;
  std::uint64_t seed = 1;
};

/// [N, latent_size] for the N trajectories of the columns, which have the form of the model.
torch::Tensor fit_latents(const LawColumns& columns, const models::TrainedModel& model,
                          const LatentFitOptions& options);

/// Declares and reads the section `fit`; the keys of its loss only `with_loss`: where there is no
/// training to take them from.
LatentFitOptions read_latent_fit_options(Section& config, bool with_loss);

}  // namespace uniphy
