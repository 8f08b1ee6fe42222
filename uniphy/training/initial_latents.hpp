#pragma once

#include <torch/torch.h>

#include "uniphy/training/law_columns.hpp"
#include "uniphy/training/networks.hpp"

namespace uniphy {

/// z before training, [trajectories, latent_size], a leaf. The scale coordinates start at the
/// trajectory's own stress and strain, so that both networks see numbers near one from the first
/// step; the others start small, from the generator.
torch::Tensor initial_latents(const LawColumns& columns, const NetworkOptions& network,
                              torch::Generator& generator);

}  // namespace uniphy
