#pragma once

#include <vector>

#include "ops/base/torch.hpp"
#include "uniphy/report/experiment.hpp"
#include "uniphy/training/trainer.hpp"

namespace uniphy {

/// history.csv and training.png; held-out curves where the history has them.
void write_training_curves(const RunDirectory& out, const std::vector<TrainingPoint>& history);

/// The codes in their first two principal components:
/// latents.png coloured by material, latents_mu.png by log10 of mu (newtonian: its viscosity).
/// Nothing where there are fewer than two codes or coordinates.
void plot_latents(const RunDirectory& out, const models::LatentCodes& codes);

}  // namespace uniphy
